"""What became of a spoilt recording: refused, not explained, undecided, right, or an undetected error."""

from typing import Any

from emaphm.actuator import Faults
from emaphm.actuator.faults import whole_turns
from emaphm.diagnosis.error_metric import WRONG_ERROR, WRONG_HALF_WIDTHS
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.verdict import Estimate

UNDETECTED_ERROR = "silent wrong"
"""Undetected error, as stored results have it."""

OUTCOMES = ("refused", "not explained", "cannot tell", "right", UNDETECTED_ERROR)
"""An error message instead of a diagnosis; a diagnosis that does not claim to explain the recording; one that
does, without a definite verdict; with definite verdicts that are right; with one that is wrong."""

OUTCOME_TITLES = (*OUTCOMES[:-1], "undetected error")
"""The outcomes in headers of tables."""


def wrong_components(diagnosis: Diagnosis, truth: Faults) -> list[str]:
    """Return the components that have a definite verdict, are called identifiable, and are wrong.

    By more than `WRONG_ERROR` and more than `WRONG_HALF_WIDTHS` half-widths of the interval. The direction of
    an eccentricity counts where there is an eccentricity in truth.
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
    """Return whether a component is called healthy or degraded, and its value is claimed to be known."""
    return estimate.verdict != "cannot tell" and estimate.identifiable


def judged(diagnosis: Diagnosis, truth: Faults) -> dict[str, Any]:
    """Return the outcome of a diagnosis, and what it rests on, ready for JSON."""
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
        "intervals": [list(one.interval95) for one in diagnosis.components.values()],
        "verdicts": [one.verdict for one in diagnosis.components.values()],
        "relative_residual": diagnosis.relative_residual,
        "also_estimated": [*diagnosis.selected, *diagnosis.laws],
    }


def refused(message: str) -> dict[str, Any]:
    """Return the outcome of a recording that was refused with that `message`."""
    return {"outcome": "refused", "wrong": [], "reasons": [], "refusal": message}
