"""Correcting the averaged model's bias with a few runs of the reference model (PHYSICS.md section 7).

The averaged model is not the reference model, so its best fit is biased. What separates the two at the
estimate is subtracted from the recording, and the fit repeated from there: space mapping, or a
multi-fidelity additive correction (Bandler et al. 2004; March and Willcox 2012).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from emaphm.identification.hybrid import descend
from emaphm.identification.problem import Problem
from emaphm.identification.space import FaultSpace
from emaphm.simulation import REFERENCE

Array = NDArray[np.float64]

MOST_TURNS = 8

SETTLED = 5e-3
"""A turn that moves the estimate by less than this is the last: switching chaos alone moves it by as much."""

LONGEST_S = 30.0
"""Recordings up to here are corrected: beyond, the reference model's steps would fill gigabytes."""

CHAOS = 1.1
"""Two runs of the reference model that differ by rounding alone differ in misfit by several percent."""


@dataclass(frozen=True, eq=False)
class Corrected:
    """An estimate and the `correction` [A], (samples,), that the model's current had when it was found.

    `discrepancy` is that correction as it stands at the estimate itself: the two differ by what a
    further turn would still change. `evaluations` counts the averaged model's runs, `reference_runs` the
    reference model's.
    """

    point: Array
    correction: Array
    discrepancy: Array
    evaluations: int
    reference_runs: int


def has_reference(problem: Problem) -> bool:
    """Return whether the reference model can run: windings described, the recording not too long."""
    return problem.actuator.electrical is not None and problem.recording.duration_s <= LONGEST_S


def discrepancy(problem: Problem, reference: Problem, faults: Array) -> Array:
    """Return the reference model's current less the problem's model's [A] at `faults` (8,), (samples,)."""
    return np.asarray(reference.signals(faults)["current_A"] - problem.currents(faults[np.newaxis])[0])


def correct(
    problem: Problem,
    space: FaultSpace,
    point: Array,
    turns: int,
    on_progress: Callable[[float], None] | None = None,
) -> Corrected:
    """Return the estimate after up to `turns` corrections of the fit at `point` (d,).

    Each turn is nearer to the fixed point than the one before, so the last is returned at which the
    reference model itself is no farther from the recording than switching chaos can make it seem.
    """
    reference = Problem.of(problem.recording, problem.actuator, REFERENCE)
    nothing = np.zeros_like(problem.recorded)
    current = Corrected(point, nothing, discrepancy(problem, reference, space.faults(point)), 1, 1)
    best, least = current, _misfit(problem, space, current)
    evaluations = 2
    for turn in range(turns):
        fit = descend(problem, space, current.point, current.discrepancy)
        evaluations += fit.evaluations + 2
        moved = float(np.linalg.norm(fit.points[0] - current.point))
        remaining = discrepancy(problem, reference, space.faults(fit.points[0]))
        current = Corrected(fit.points[0], current.discrepancy, remaining, evaluations, turn + 2)
        misfit = _misfit(problem, space, current)
        if misfit < CHAOS * least:
            best = current
        least = min(least, misfit)
        if moved < SETTLED:
            break
        if on_progress:
            on_progress((turn + 1) / turns)
    return replace(best, evaluations=evaluations, reference_runs=current.reference_runs)


def _misfit(problem: Problem, space: FaultSpace, estimate: Corrected) -> float:
    """Return the mean squared difference [A²] between the recording and the reference model at `estimate`."""
    averaged = problem.currents(space.faults(estimate.point)[np.newaxis])[0]
    return float(np.mean((problem.recorded - averaged - estimate.discrepancy) ** 2))
