"""What a calibrated model leaves that is no noise, where the recordings do not show how it differs elsewhere.

A standard error covers noise, and what the model lacks as far as recordings show it: it is another in each
manoeuvre. One manoeuvre does not show that at all, and two hardly do: the standard deviation of values may be
16 times that which two of them have (95 %). Forward strokes of EMPS have an inertia of 94.4 kg, backward ones
of 95.7 kg, with 0.2 to 0.3 kg of standard error by their residuals alone.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from emaphm.actuator.unit.model_error import ModelError
from emaphm.calibration.lack_of_fit import BY_CHANCE, slow_share
from emaphm.calibration.unit_fit import UnitFit
from emaphm.calibration.warnings.units_and_signs import UNRESEMBLED
from emaphm.diagnosis.explanation.residuals import residual_within_limits
from emaphm.diagnosis.explanation.settings import RESIDUAL_LIMITS
from emaphm.estimation.compared_channels import TORQUE_CURRENTS
from emaphm.estimation.discrepancy import resolves_switching

FEW = 2
"""Manoeuvres of which the scatter says next to nothing."""

COUNTED = {1: "one manoeuvre", FEW: "two manoeuvres"}

SLOW, LEAST = 0.2, 0.005
"""Share of a residual's mean square that is no white noise, and size of the residual relative to the channel,
from which a model lacks something."""


LAWS_TO_TRY = "let laws be tried (--laws auto, by two recordings or more), or name one"
LAWS_TRIED = (
    "of the laws that were tried none explains it: estimate what was kept too (--free), correct it, or name "
    "a law that was not taken (--laws)"
)
"""What helps a description that lacks something, before laws were tried and after."""


def unmodelled_warnings(
    fit: UnitFit, sources: Sequence[str], learned: ModelError, *, laws_tried: bool
) -> tuple[str, ...]:
    """Return a sentence on each recording with more left than a diagnosis allows, and one on few manoeuvres.

    Parameters
    ----------
    sources
        What the recordings are called.
    learned
        The error of the model by recordings left out: a diagnosis compares a residual with that one.
    laws_tried
        Whether laws were chosen among all.
    """
    return (
        *_missing_law(fit, sources, LAWS_TRIED if laws_tried else LAWS_TO_TRY),
        *_beyond(fit, sources, learned),
        *_of_few_manoeuvres(fit),
    )


def _missing_law(fit: UnitFit, sources: Sequence[str], advice: str) -> Iterator[str]:
    """Yield a sentence on the recordings of which more is left than noise and switching."""
    # Of a channel that the model does not resemble, another warning says more.
    lacking = [
        (one, source)
        for one, source in zip(fit.lacks, sources, strict=True)
        if one.has_any and one.relative**2 <= UNRESEMBLED
    ]
    if not lacking:
        return
    worst, source = max(lacking, key=lambda one: one[0].ratio)
    where = f"in {len(lacking)} of {len(sources)} recordings, " if len(sources) > 1 else ""
    left = f"{100 * worst.relative:.2g} % of {worst.result.objective.problem.primary}"
    yield (
        f"{where}up to {worst.ratio:.2g} times what noise and switching explain is left ({left}, {source}): "
        "the description lacks a law, or is wrong in what was kept of it; the standard errors are widened by "
        f"as large an error that looks like the parameters, and need not cover it; {advice}"
    )


def _beyond(fit: UnitFit, sources: Sequence[str], learned: ModelError) -> Iterator[str]:
    allowed = 100 * RESIDUAL_LIMITS[False].model
    for one, source in zip(fit.lacks, sources, strict=True):
        problem = one.result.objective.problem
        known = resolves_switching(problem) or learned.of(problem.primary) is not None
        if known or problem.primary not in TORQUE_CURRENTS:
            continue
        if not residual_within_limits(problem.recorded, one.residual, problem.noise, corrected=False):
            left = f"{100 * one.relative:.3g} % of {problem.primary}"
            yield (
                f"{source}: {left} is left, more than noise and the {allowed:g} % that a diagnosis allows "
                "the model, so that no such recording is explained; add the law that acts (--laws), or "
                "record at a higher rate, unfiltered"
            )


def _of_few_manoeuvres(fit: UnitFit) -> Iterator[str]:
    """Yield a sentence where the model lacks something, and the manoeuvres are too few to show its effect."""
    scatter = fit.contradictions is not None and bool(np.any(fit.contradictions.covariance))
    count = fit.uncertainty.manoeuvres
    if scatter or count > FEW:
        return
    left = dict[str, float]()
    for one in fit.lacks:
        problem = one.result.objective.problem
        slow = slow_share(one.residual) > max(SLOW, BY_CHANCE / problem.samples**0.5)
        if slow and one.relative > LEAST and not resolves_switching(problem):
            left[problem.primary] = max(one.relative, left.get(problem.primary, 0.0))
    if left:
        sizes = " and ".join(f"{100 * size:.2g} % of {name}" for name, size in left.items())
        yield (
            f"the model leaves {sizes} that is no noise, and {COUNTED[count]} cannot show what others would "
            "ask for: the standard errors need not cover it; calibrate on other directions, speeds and loads "
            "too, and compare by replay"
        )
