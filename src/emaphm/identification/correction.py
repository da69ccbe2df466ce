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
from emaphm.identification.refinement import information, scattered
from emaphm.identification.space import FaultSpace
from emaphm.simulation import REFERENCE

Array = NDArray[np.float64]

MOST_TURNS = 8

SETTLED = 5e-3
"""After a turn that moves the estimate by less, polish is left: switching chaos alone moves it so far."""

POLISHES, POLISH_STEP, POLISH_POINTS = 2, 1e-2, 4
"""Turns of polish, the step of their differences, and the points that these are taken about."""

FARTHEST = 0.1
"""Longest step of polish."""

WORSE = 1.05
"""Cost that a step of polish may leave, as a multiple: kinks alone make it vary by some percent."""

CORRELATED_ROWS = 20
"""Rows over which a residual is correlated, roughly: so many count as one against a prior."""

PRIOR_DEVIATION = 1 / 12**0.5
"""Of a component that may be anywhere in [0, 1]."""

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

    Once the descents have settled, the last turns polish. Each turn is nearer to the fixed point than the
    one before, so the last is returned at which the
    reference model itself is no farther from the recording than switching chaos can make it seem.
    """
    reference = Problem.of(problem.recording, problem.actuator, REFERENCE)
    nothing = np.zeros_like(problem.recorded)
    current = Corrected(point, nothing, discrepancy(problem, reference, space.faults(point)), 1, 1)
    best, least = current, _misfit(problem, space, current)
    descending, polished = True, 0
    for turn in range(turns):
        step = _descended if descending else _polished
        found, evaluations = step(problem, space, current, turn)
        moved = float(np.linalg.norm(found - current.point))
        current = Corrected(
            found,
            current.discrepancy,
            discrepancy(problem, reference, space.faults(found)),
            current.evaluations + evaluations + 2,
            turn + 2,
        )
        misfit = _misfit(problem, space, current)
        if misfit < CHAOS * least:
            best = current
        least = min(least, misfit)
        polished += not descending
        descending = descending and moved >= SETTLED
        if polished == POLISHES:
            break
        if on_progress:
            on_progress((turn + 1) / turns)
    if on_progress:
        on_progress(1.0)
    return replace(best, evaluations=current.evaluations + 1, reference_runs=current.reference_runs)


def _descended(problem: Problem, space: FaultSpace, current: Corrected, _turn: int) -> tuple[Array, int]:
    """Return where least squares lead under the present correction, and the simulations spent."""
    found = descend(problem, space, current.point, current.discrepancy)
    return found.points[0], found.evaluations


def _polished(problem: Problem, space: FaultSpace, current: Corrected, turn: int) -> tuple[Array, int]:
    """Return the point one Gauss-Newton step on, by derivatives about several points, and the runs spent.

    A descent is caught in the kinks of stick-slip, in whichever happens to lie in its way; derivatives
    about several points see past them. The step counts where it is hardly worse in the kinks' own terms.
    """

    def simulate(points: Array) -> Array:
        return problem.currents(space.faults(points)) + current.discrepancy

    point = current.point
    derivatives, spent = scattered(simulate, point, space, POLISH_STEP, POLISH_POINTS, seed=turn)
    residual = problem.recorded - simulate(point[np.newaxis])[0]
    gradient = derivatives.mean(axis=0) @ residual
    cost = float(np.mean(residual**2))
    normal = information(derivatives) + cost * CORRELATED_ROWS / PRIOR_DEVIATION**2 * np.eye(point.size)
    outward = ((point <= space.lower) & (gradient < 0)) | ((point >= space.upper) & (gradient > 0))
    free = np.flatnonzero(~outward)
    step = np.zeros(point.size)
    step[free] = np.linalg.solve(normal[np.ix_(free, free)], gradient[free])
    step *= min(1.0, FARTHEST / max(float(np.linalg.norm(step)), FARTHEST))
    trials = space.project(point + np.array([[1.0], [0.5], [0.25]]) * step)
    costs = np.mean((problem.recorded - simulate(trials)) ** 2, axis=1)
    good = np.flatnonzero(costs <= WORSE * cost)
    return (trials[good[0]] if good.size else point), spent + 1 + len(trials)


def _misfit(problem: Problem, space: FaultSpace, estimate: Corrected) -> float:
    """Return the mean squared difference [A²] between the recording and the reference model at `estimate`."""
    averaged = problem.currents(space.faults(estimate.point)[np.newaxis])[0]
    return float(np.mean((problem.recorded - averaged - estimate.discrepancy) ** 2))
