"""Bounded damped least squares from several starts at once (Levenberg 1944, Marquardt 1963).

Every iteration asks for two batches of simulations, for all starts together: finite-difference
Jacobians, then several damped steps for each start, of which the best is taken.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.estimation.finite_differences import Simulate, one_sided_jacobians
from emaphm.estimation.parameter_space import Box

DAMPING_FACTORS = np.array([0.1, 1.0, 10.0, 100.0])
"""Steps tried at once, as multiples of the current damping."""

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-2, 1e-9, 1e6
"""Damping relative to the diagonal of the normal matrix, as Marquardt scales it."""


@dataclass(frozen=True)
class LeastSquaresSettings:
    """How a descent proceeds.

    `step` is that of the finite differences, in the unit of a coordinate: large enough to bridge the kinks
    of stick-slip. A start has converged when an iteration reduces its cost by less than the fraction
    `least_gain`; it ends after `iterations` at the latest.
    """

    step: float = 2e-3
    iterations: int = 12
    least_gain: float = 1e-4


@dataclass(frozen=True, eq=False)
class LeastSquaresResult:
    """Where each start ended: `points` (m, d), and mean squared residuals `costs` (m,)."""

    points: Array
    costs: Array

    @property
    def best(self) -> Array:
        """The point (d,) of the least cost."""
        return np.asarray(self.points[int(np.argmin(self.costs))])


@dataclass
class _Descent:
    """One start's progress; lives only inside `least_squares`."""

    point: Array
    residual: Array
    cost: float
    damping: float = FIRST_DAMPING
    done: bool = False


def least_squares(
    simulate: Simulate,
    target: Array,
    starts: Array,
    box: Box,
    settings: LeastSquaresSettings = LeastSquaresSettings(),
    on_iteration: Callable[[int], None] | None = None,
) -> LeastSquaresResult:
    """Minimise the mean squared residual of `simulate` against `target` (rows,) from `starts` (m, d).

    `on_iteration` is called with the number of iterations done.
    """
    points = box.project(np.array(starts, float))
    residuals = target - simulate(points)
    descents = [
        _Descent(point, residual, float(np.mean(residual**2)))
        for point, residual in zip(points, residuals, strict=True)
    ]
    for iteration in range(settings.iterations):
        active = [descent for descent in descents if not descent.done]
        if not active:
            break
        points = np.stack([descent.point for descent in active])
        residuals = np.stack([descent.residual for descent in active])
        jacobians = one_sided_jacobians(simulate, points, target - residuals, box, settings.step)
        trials = np.stack([_trials(d, j, box) for d, j in zip(active, jacobians, strict=True)])
        outcomes = target - simulate(trials.reshape(-1, box.lower.size)).reshape(*trials.shape[:2], -1)
        for descent, tried, left in zip(active, trials, outcomes, strict=True):
            _accept(descent, tried, left, settings.least_gain)
        if on_iteration is not None:
            on_iteration(iteration + 1)
    return LeastSquaresResult(
        np.stack([descent.point for descent in descents]), np.array([descent.cost for descent in descents])
    )


def movable(point: Array, gradient: Array, box: Box) -> NDArray[np.intp]:
    """Return the indices of the components of `point` (d,) that no bound keeps from following `gradient`."""
    at_lower = (point <= box.lower) & (gradient < 0)
    at_upper = (point >= box.upper) & (gradient > 0)
    return np.flatnonzero(~(at_lower | at_upper))


def _trials(descent: _Descent, jacobian: Array, box: Box) -> Array:
    """Return the points (factors, d) that damped Gauss-Newton steps lead to, one for each damping factor."""
    normal = jacobian @ jacobian.T
    gradient = jacobian @ descent.residual
    free = movable(descent.point, gradient, box)
    trials = np.tile(descent.point, (len(DAMPING_FACTORS), 1))
    if free.size:
        normal = normal[np.ix_(free, free)]
        scale = np.diag(normal)
        # A component without effect would otherwise leave the equations singular.
        scale = np.maximum(scale, 1e-9 * max(scale.max(), np.finfo(float).tiny))
        damping = descent.damping * DAMPING_FACTORS[:, np.newaxis, np.newaxis] * np.diag(scale)
        trials[:, free] += np.linalg.solve(normal + damping, gradient[free, np.newaxis])[:, :, 0]
    return box.project(trials)


def _accept(descent: _Descent, trials: Array, residuals: Array, least_gain: float) -> None:
    """Move `descent` to its best trial, or raise its damping if none is better."""
    costs = np.mean(residuals**2, axis=1)
    best = int(np.argmin(costs))
    if costs[best] < descent.cost:
        descent.done = costs[best] > (1 - least_gain) * descent.cost
        descent.point, descent.residual, descent.cost = trials[best], residuals[best], float(costs[best])
        descent.damping = max(descent.damping * DAMPING_FACTORS[best], LEAST_DAMPING)
    else:
        descent.damping *= 10 * DAMPING_FACTORS[-1]
        descent.done = descent.damping > MOST_DAMPING
