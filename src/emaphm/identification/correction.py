"""Correcting the averaged model's bias with a few runs of the reference model (PHYSICS.md section 7).

The averaged model is not the reference model, so its best fit is biased. What separates the two at the
estimate is subtracted from the recording, and the fit repeated from there: space mapping, or a
multi-fidelity additive correction (Bandler et al. 2004; March and Willcox 2012).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from emaphm.identification.fit import CORRELATED_ROWS, Fit
from emaphm.identification.hybrid import descend
from emaphm.identification.problem import Problem
from emaphm.identification.refinement import information, movable, scattered
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

PRIOR_DEVIATION = 1 / 12**0.5
"""Of a component that may be anywhere in [0, 1]."""

LONGEST_S = 30.0
"""Recordings up to here are corrected: beyond, the reference model's steps would fill gigabytes."""

CHAOS = 1.1
"""Two runs of the reference model that differ by rounding alone differ in misfit by several percent."""


@dataclass(frozen=True, eq=False)
class Corrected:
    """An estimate and the `correction`, (rows,), that the `outputs` of its `fit` had when it was found.

    `discrepancy` is that correction as it stands at the estimate itself: the two differ by what a
    further turn would still change. `evaluations` counts the averaged model's runs, `reference_runs` the
    reference model's.
    """

    fit: Fit
    point: Array
    correction: Array
    discrepancy: Array
    evaluations: int
    reference_runs: int

    def residual(self) -> Array:
        """Return what was recorded less what the reference model has at the estimate, (rows,)."""
        return np.asarray(self.fit.target - self.fit.outputs(self.point[np.newaxis])[0] - self.discrepancy)

    def misfit(self, weighted: Fit) -> float:
        """Return the mean squared `residual` [A²], weighted as in another fit."""
        return float(np.mean(weighted.rescaled(self.residual(), self.fit) ** 2))

    def reweighted(self) -> "Corrected":
        """Return the estimate with its channels weighted by its residuals."""
        fit = self.fit.reweighted(self.residual())
        correction, discrepancy = (
            fit.rescaled(rows, self.fit) for rows in (self.correction, self.discrepancy)
        )
        return replace(self, fit=fit, correction=correction, discrepancy=discrepancy)


def has_reference(problem: Problem) -> bool:
    """Return whether the reference model can run: windings described, the recording not too long."""
    return problem.actuator.electrical is not None and problem.recording.duration_s <= LONGEST_S


def correct(
    fit: Fit,
    point: Array,
    turns: int,
    on_progress: Callable[[float], None] | None = None,
) -> Corrected:
    """Return the estimate after up to `turns` corrections of the fit at `point` (d,).

    Once the descents have settled, the last turns polish. Each turn is nearer to the fixed point than the
    one before, so the last is returned at which the reference model itself is no farther from the
    recording than switching chaos can make it seem.
    """
    nothing = np.zeros_like(fit.target)
    reference = fit.problem.by(REFERENCE)
    current = Corrected(fit, point, nothing, fit.discrepancy(reference, point), 1, 1)
    best, least = current, current.misfit(fit)
    descending, polished = True, 0
    for turn in range(turns):
        current = current.reweighted()
        found, evaluations = (_descended if descending else _polished)(current, turn)
        moved = float(np.linalg.norm(found - current.point))
        current = replace(
            current,
            point=found,
            correction=current.discrepancy,
            discrepancy=current.fit.discrepancy(reference, found),
            evaluations=current.evaluations + evaluations + 3,
            reference_runs=turn + 2,
        )
        misfit = current.misfit(fit)
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


def _descended(current: Corrected, _turn: int) -> tuple[Array, int]:
    """Return where least squares lead under the present correction, and the simulations spent."""
    found = descend(current.fit, current.point, current.discrepancy)
    return found.points[0], found.evaluations


def _polished(current: Corrected, turn: int) -> tuple[Array, int]:
    """Return the point one Gauss-Newton step on, by derivatives about several points, and the runs spent.

    A descent is caught in the kinks of stick-slip, in whichever happens to lie in its way; derivatives
    about several points see past them. The step counts where it is hardly worse in the kinks' own terms.
    """
    fit, point, space = current.fit, current.point, current.fit.space

    def simulate(points: Array) -> Array:
        return fit.outputs(points) + current.discrepancy

    derivatives, spent = scattered(simulate, point, space, POLISH_STEP, POLISH_POINTS, seed=turn)
    residual = fit.target - simulate(point[np.newaxis])[0]
    gradient = derivatives.mean(axis=0) @ residual
    cost = float(np.mean(residual**2))
    normal = information(derivatives) + cost * CORRELATED_ROWS / PRIOR_DEVIATION**2 * np.eye(point.size)
    free = movable(point, gradient, space)
    step = np.zeros(point.size)
    step[free] = np.linalg.solve(normal[np.ix_(free, free)], gradient[free])
    step *= min(1.0, FARTHEST / max(float(np.linalg.norm(step)), FARTHEST))
    trials = space.project(point + np.array([[1.0], [0.5], [0.25]]) * step)
    costs = np.mean((fit.target - simulate(trials)) ** 2, axis=1)
    good = np.flatnonzero(costs <= WORSE * cost)
    return (trials[good[0]] if good.size else point), spent + 1 + len(trials)
