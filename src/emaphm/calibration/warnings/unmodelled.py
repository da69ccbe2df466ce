"""What a calibrated model leaves that is no noise, where the recordings do not show how it differs elsewhere.

A standard error covers noise, and what the model lacks as far as recordings show it: it is another in each
manoeuvre. One manoeuvre does not show that at all, and two hardly do: the standard deviation of values may be
16 times that which two of them have (95 %). Forward strokes of EMPS have an inertia of 94.4 kg ± 0.2 kg,
backward ones of 95.7 kg ± 0.3 kg.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from emaphm.actuator.unit.model_error import ModelError
from emaphm.arrays import Array
from emaphm.calibration.unit_fit import UnitFit
from emaphm.diagnosis.diagnose import TORQUE_CURRENTS
from emaphm.diagnosis.explanation.reasons import EXPLAINED, is_explained
from emaphm.estimation.discrepancy import resolves_switching
from emaphm.estimation.problem import rms

FEW = 2
"""Manoeuvres of which the scatter says next to nothing."""

COUNTED = {1: "one manoeuvre", FEW: "two manoeuvres"}

SLOW, LEAST = 0.2, 0.005
"""Share of a residual's mean square that is no white noise, and size of the residual relative to the channel,
from which a model lacks something."""

BY_CHANCE = 4.0
"""Largest such share of n rows of white noise, in its standard deviation 1/√n (von Neumann 1941)."""


def unmodelled_warnings(fit: UnitFit, sources: Sequence[str], learned: ModelError) -> tuple[str, ...]:
    """Return a sentence on each recording with more left than a diagnosis allows, and one on few manoeuvres.

    Parameters
    ----------
    sources
        What the recordings are called.
    learned
        The error of the model by recordings left out: a diagnosis compares a residual with that one.
    """
    return (*_beyond(fit, sources, learned), *_of_few_manoeuvres(fit))


def _beyond(fit: UnitFit, sources: Sequence[str], learned: ModelError) -> Iterator[str]:
    allowed = 100 * EXPLAINED[False].model
    for term, residual, source in zip(fit.joint.terms, _residuals(fit), sources, strict=True):
        problem = term.objective.problem
        known = resolves_switching(problem) or learned.of(problem.primary) is not None
        if known or problem.primary not in TORQUE_CURRENTS:
            continue
        if not is_explained(problem.recorded, residual, problem.noise, corrected=False):
            left = f"{100 * _relative(residual, problem.recorded):.3g} % of {problem.primary}"
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
    for term, residual in zip(fit.joint.terms, _residuals(fit), strict=True):
        problem = term.objective.problem
        relative = _relative(residual, problem.recorded)
        slow = _slow_share(residual) > max(SLOW, BY_CHANCE / residual.size**0.5)
        if slow and relative > LEAST and not resolves_switching(problem):
            left[problem.primary] = max(relative, left.get(problem.primary, 0.0))
    if left:
        sizes = " and ".join(f"{100 * size:.2g} % of {name}" for name, size in left.items())
        yield (
            f"the model leaves {sizes} that is no noise, and {COUNTED[count]} cannot show what others would "
            "ask for: the standard errors do not cover it; calibrate on other directions, speeds and loads "
            "too, and compare by replay"
        )


def _residuals(fit: UnitFit) -> list[Array]:
    """Return measured less modelled of each recording's primary channel, in its unit, (samples,)."""
    problems = [term.objective.problem for term in fit.joint.terms]
    residuals = fit.estimate.corrected_residuals
    return [one[: p.samples] / p.weights[0] for one, p in zip(residuals, problems, strict=True)]


def _relative(residual: Array, recorded: Array) -> float:
    size = rms(recorded)
    return rms(residual) / size if size > 0 else 0.0


def _slow_share(residual: Array) -> float:
    """Return the share of a mean square that differs less from row to row than white noise (von Neumann)."""
    square = float(np.mean(residual**2))
    return 1 - float(np.mean(np.diff(residual) ** 2)) / (2 * square) if square > 0 else 0.0
