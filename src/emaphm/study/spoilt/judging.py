"""Outcome of a spoilt recording: refused, not explained, undecided, right, or an undetected error."""

from typing import Any

from emaphm.actuator import Faults
from emaphm.actuator.faults import whole_turns
from emaphm.diagnosis.error_metric import WRONG_ERROR, WRONG_HALF_WIDTHS
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.verdict import Estimate

UNDETECTED_ERROR = "silent wrong"
"""Name of an undetected error in stored results."""

OUTCOMES = ("refused", "not explained", "cannot tell", "right", UNDETECTED_ERROR)
"""An error message instead of a diagnosis; a recording that is not explained; an explained recording without
a definite verdict, with correct definite verdicts only, or with a wrong one."""

OUTCOME_TITLES = (*OUTCOMES[:-1], "undetected error")
"""Names of the outcomes in headers of tables."""


def wrong_components(diagnosis: Diagnosis, truth: Faults) -> list[str]:
    """Return the components with a definite verdict whose estimate is wrong.

    The error is more than `WRONG_ERROR` and more than `WRONG_HALF_WIDTHS` half-widths of the interval. The
    direction of an eccentricity counts only if there is a true eccentricity.
    """
    wrong = []
    for name, estimate in diagnosis.components.items():
        if name == "eccentricity_phase" and truth.eccentricity == 0:
            continue
        difference = estimate.value - float(getattr(truth, name))
        error = min(abs(difference + turn) for turn in whole_turns(name))
        low, high = estimate.interval95
        if definite(estimate) and error > max(WRONG_ERROR, WRONG_HALF_WIDTHS * (high - low) / 2):
            wrong.append(name)
    return wrong


def definite(estimate: Estimate) -> bool:
    """Return whether a component is called healthy or degraded, and identifiable."""
    return estimate.verdict != "cannot tell" and estimate.identifiable


def judged(diagnosis: Diagnosis, truth: Faults) -> dict[str, Any]:
    """Return the outcome of a diagnosis with its estimates and verdicts, as JSON values."""
    wrong = wrong_components(diagnosis, truth)
    if not diagnosis.explained:
        outcome = "not explained"
    elif wrong:
        outcome = UNDETECTED_ERROR
    else:
        outcome = "right" if any(map(definite, diagnosis.components.values())) else "cannot tell"
    return {
        "outcome": outcome,
        "wrong": wrong,
        "reasons": list(getattr(diagnosis, "reasons", ())),
        "refusal": "",
        "values": diagnosis.faults.vector.tolist(),
        "intervals": [list(estimate.interval95) for estimate in diagnosis.components.values()],
        "verdicts": [estimate.verdict for estimate in diagnosis.components.values()],
        "relative_residual": diagnosis.relative_residual,
        "also_estimated": [*diagnosis.selected, *diagnosis.laws],
    }


def refused(message: str) -> dict[str, Any]:
    """Return the outcome of a recording that was refused with this `message`."""
    return {"outcome": "refused", "wrong": [], "reasons": [], "refusal": message}
