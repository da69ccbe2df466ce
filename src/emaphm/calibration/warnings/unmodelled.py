"""Warnings on residuals that noise does not explain, and whose effect on the estimates is unknown.

A standard error includes noise, and the errors of the model as far as recordings of different manoeuvres
scatter. The scatter cannot be measured with one manoeuvre, and hardly with two: the true standard deviation
may be 16 times that of two values (95 %). Forward strokes of EMPS give an inertia of 94.4 kg and backward
strokes of 95.7 kg, with a standard error of 0.2 to 0.3 kg from the residuals alone.
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
from emaphm.recording.reconstruction import DENSE_S

FEW = 2
"""Largest number of manoeuvres whose scatter is not informative."""

COUNTED = {1: "one manoeuvre", FEW: "two manoeuvres"}

SLOW, LEAST = 0.2, 0.005
"""Limits of `slow_share` and of the relative residual of a channel, above which the model lacks an effect."""


LAWS_TO_TRY = "let laws be tried (--laws auto, by two recordings or more), or name one"
LAWS_TRIED = (
    "none of the tried laws explains it: estimate kept parameters as well (--free), correct them, or name a "
    "law that was not chosen (--laws)"
)
"""Advice for a description that lacks an effect, before and after laws were tried."""

HELD_COMMAND = (
    "if the drive holds each row of the command until the next one, state command_held under [channels]"
)
"""Further advice for rows that are so slow that a held command differs from a curve through its rows."""


def unmodelled_warnings(
    fit: UnitFit, sources: Sequence[str], learned: ModelError, *, laws_tried: bool
) -> tuple[str, ...]:
    """Return sentences on residuals that noise does not explain, and on too few manoeuvres.

    Parameters
    ----------
    sources
        Names of the recordings.
    learned
        Error of the model from recordings left out, with which a diagnosis compares a residual.
    laws_tried
        Whether laws were selected automatically.
    """
    return (
        *_missing_law(fit, sources, LAWS_TRIED if laws_tried else LAWS_TO_TRY),
        *_beyond_limits(fit, sources, learned),
        *_of_few_manoeuvres(fit),
    )


def _missing_law(fit: UnitFit, sources: Sequence[str], advice: str) -> Iterator[str]:
    """Yield a sentence on the recordings whose residual exceeds noise and switching."""
    # Another warning covers channels that the model does not resemble.
    lacking = [
        (lack, source)
        for lack, source in zip(fit.lacks, sources, strict=True)
        if lack.has_any and lack.relative**2 <= UNRESEMBLED
    ]
    if not lacking:
        return
    worst, source = max(lacking, key=lambda pair: pair[0].ratio)
    where = f"in {len(lacking)} of {len(sources)} recordings, " if len(sources) > 1 else ""
    problem = worst.result.objective.problem
    size = f"{100 * worst.relative:.2g} % of {problem.primary}"
    if problem.driving.interval > DENSE_S and not problem.actuator.channels.command_held:
        advice = f"{advice}; {HELD_COMMAND}"
    yield (
        f"{where}the residual is up to {worst.ratio:.2g} times what noise and switching explain ({size}, "
        f"{source}): the description lacks a law, or a kept parameter is wrong; the standard errors include "
        "an error of this size that resembles the parameters, but need not cover the true error; "
        f"{advice}"
    )


def _beyond_limits(fit: UnitFit, sources: Sequence[str], learned: ModelError) -> Iterator[str]:
    """Yield a sentence on each recording whose residual exceeds the limits of a diagnosis."""
    allowed = 100 * RESIDUAL_LIMITS[False].model
    for lack, source in zip(fit.lacks, sources, strict=True):
        problem = lack.result.objective.problem
        known = resolves_switching(problem) or learned.of(problem.primary) is not None
        if known or problem.primary not in TORQUE_CURRENTS:
            continue
        if not residual_within_limits(problem.recorded, lack.residual, problem.noise, corrected=False):
            size = f"{100 * lack.relative:.3g} % of {problem.primary}"
            yield (
                f"{source}: the residual is {size}, more than noise and the {allowed:g} % that a diagnosis "
                "allows for the model, so that no such recording is explained; add the missing law (--laws), "
                "or record at a higher rate, unfiltered"
            )


def _of_few_manoeuvres(fit: UnitFit) -> Iterator[str]:
    """Yield a sentence if the model lacks an effect and the manoeuvres are too few to measure it."""
    scatter = fit.contradictions is not None and bool(np.any(fit.contradictions.covariance))
    count = fit.uncertainty.manoeuvres
    if scatter or count > FEW:
        return
    largest = dict[str, float]()
    for lack in fit.lacks:
        problem = lack.result.objective.problem
        slow = slow_share(lack.residual) > max(SLOW, BY_CHANCE / problem.samples**0.5)
        if slow and lack.relative > LEAST and not resolves_switching(problem):
            largest[problem.primary] = max(lack.relative, largest.get(problem.primary, 0.0))
    if largest:
        sizes = " and ".join(f"{100 * size:.2g} % of {name}" for name, size in largest.items())
        yield (
            f"the model leaves a residual of {sizes} that is no noise, and {COUNTED[count]} cannot show how "
            "the estimates differ in other manoeuvres: the standard errors need not cover this difference; "
            "calibrate on other directions, speeds and loads as well, and compare by replay"
        )
