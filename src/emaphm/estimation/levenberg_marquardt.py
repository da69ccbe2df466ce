"""Bounded damped least squares from several starts at once (Levenberg 1944, Marquardt 1963).

Every iteration evaluates two batches of simulations, each for all starts together: finite-difference
Jacobians, then several damped steps for each start, of which the best is taken.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.estimation.finite_differences import Simulate, one_sided_jacobians
from emaphm.estimation.space.parameter_space import Box

DAMPING_FACTORS = np.array([0.1, 1.0, 10.0, 100.0])
"""Steps tried at once, as multiples of the current damping."""

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-2, 1e-9, 1e6
"""Damping relative to the diagonal of the normal matrix, as Marquardt scales it."""


@dataclass(frozen=True)
class LeastSquaresSettings:
    """Settings of a descent.

    `step` is the step of the finite differences, in the unit of a coordinate: large enough to bridge the
    kinks of stick-slip. A descent has converged when an iteration reduces its cost by less than the fraction
    `least_gain`; it ends after `iterations` iterations at the latest.
    """

    step: float = 2e-3
    iterations: int = 12
    least_gain: float = 1e-4


@dataclass(frozen=True, eq=False)
class LeastSquaresResult:
    """End points `points` (m, d) of the descents, and their mean squared residuals `costs` (m,)."""

    points: Array
    costs: Array

    @property
    def best(self) -> Array:
        """The point (d,) of the least cost."""
        return np.asarray(self.points[int(np.argmin(self.costs))])


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A `point` (d,), its `cost`, and the `residual` that a `LeastSquaresSystem` needs to linearise at it."""

    point: Array
    cost: float
    residual: Any


class LeastSquaresSystem(Protocol):
    """Residuals as a function of a point, in any layout."""

    def evaluate(self, points: Array) -> list[Evaluation]:
        """Return the evaluations of `points` (n, d)."""

    def normal_equations(self, about: Sequence[Evaluation]) -> list[tuple[Array, Array]]:
        """Return J Jᵀ (d, d) and J r (d,) at each evaluated point, with the Jacobian J and the residual r."""


@dataclass(frozen=True, eq=False)
class _Rows:
    """The system of the residuals of `simulate` against one `target` (rows,)."""

    simulate: Simulate
    target: Array
    box: Box
    step: float

    def evaluate(self, points: Array) -> list[Evaluation]:
        residuals = self.target - self.simulate(points)
        return [
            Evaluation(point, float(np.mean(residual**2)), residual)
            for point, residual in zip(points, residuals, strict=True)
        ]

    def normal_equations(self, about: Sequence[Evaluation]) -> list[tuple[Array, Array]]:
        points = np.stack([evaluation.point for evaluation in about])
        residuals = np.stack([evaluation.residual for evaluation in about])
        jacobians = one_sided_jacobians(self.simulate, points, self.target - residuals, self.box, self.step)
        return [
            (jacobian @ jacobian.T, jacobian @ residual)
            for jacobian, residual in zip(jacobians, residuals, strict=True)
        ]


@dataclass
class _Descent:
    """The state of the descent from one start, used only in `descend`."""

    current: Evaluation
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
    return descend(_Rows(simulate, target, box, settings.step), starts, box, settings, on_iteration)


def descend(
    system: LeastSquaresSystem,
    starts: Array,
    box: Box,
    settings: LeastSquaresSettings,
    on_iteration: Callable[[int], None] | None = None,
) -> LeastSquaresResult:
    """Minimise the cost of a `system` from `starts` (m, d) inside a `box`; see `least_squares`."""
    evaluations = system.evaluate(box.project(np.array(starts, float)))
    descents = [_Descent(evaluation) for evaluation in evaluations]
    for iteration in range(settings.iterations):
        active = [descent for descent in descents if not descent.done]
        if not active:
            break
        equations = system.normal_equations([descent.current for descent in active])
        trials = np.stack(
            [
                _trials(descent, normal, gradient, box)
                for descent, (normal, gradient) in zip(active, equations, strict=True)
            ]
        )
        outcomes = system.evaluate(trials.reshape(-1, box.lower.size))
        count = len(DAMPING_FACTORS)
        for i, descent in enumerate(active):
            _accept(descent, outcomes[i * count : (i + 1) * count], settings.least_gain)
        if on_iteration is not None:
            on_iteration(iteration + 1)
    return LeastSquaresResult(
        np.stack([descent.current.point for descent in descents]),
        np.array([descent.current.cost for descent in descents]),
    )


def movable(point: Array, gradient: Array, box: Box) -> NDArray[np.intp]:
    """Return the indices of the components of `point` (d,) that can follow `gradient` within the bounds."""
    at_lower = (point <= box.lower) & (gradient < 0)
    at_upper = (point >= box.upper) & (gradient > 0)
    return np.flatnonzero(~(at_lower | at_upper))


def bounded_step(normal: Array, gradient: Array, point: Array, box: Box) -> Array:
    """Return the step (d,) from `point` that solves the normal equations; 0 where a bound is active."""
    free = movable(point, gradient, box)
    step = np.zeros(point.size)
    step[free] = np.linalg.solve(normal[np.ix_(free, free)], gradient[free])
    return step


def _trials(descent: _Descent, normal: Array, gradient: Array, box: Box) -> Array:
    """Return the end points (factors, d) of damped Gauss-Newton steps, one for each damping factor."""
    point = descent.current.point
    free = movable(point, gradient, box)
    trials = np.tile(point, (len(DAMPING_FACTORS), 1))
    if free.size:
        normal = normal[np.ix_(free, free)]
        scale = np.diag(normal)
        # Otherwise a component without effect would make the equations singular.
        scale = np.maximum(scale, 1e-9 * max(scale.max(), np.finfo(float).tiny))
        damping = descent.damping * DAMPING_FACTORS[:, np.newaxis, np.newaxis] * np.diag(scale)
        trials[:, free] += np.linalg.solve(normal + damping, gradient[free, np.newaxis])[:, :, 0]
    return box.project(trials)


def _accept(descent: _Descent, trials: Sequence[Evaluation], least_gain: float) -> None:
    """Move `descent` to its best trial, or increase its damping if no trial reduces the cost."""
    best = min(range(len(trials)), key=lambda i: trials[i].cost)
    if trials[best].cost < descent.current.cost:
        descent.done = trials[best].cost > (1 - least_gain) * descent.current.cost
        descent.current = trials[best]
        descent.damping = max(descent.damping * DAMPING_FACTORS[best], LEAST_DAMPING)
    else:
        descent.damping *= 10 * DAMPING_FACTORS[-1]
        descent.done = descent.damping > MOST_DAMPING
