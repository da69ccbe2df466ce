"""Bounded damped least squares from several starts at once (Levenberg 1944, Marquardt 1963).

Every iteration asks for two batches of simulations, for all starts together: finite-difference
Jacobians, then several damped steps for each start, of which the best is taken.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.estimation.parameter_space import Box
from emaphm.optimizers.base import generator

Simulate = Callable[[Array], Array]
"""Maps points (n, d) to what a sensor would have recorded, (n, samples)."""

DAMPING_FACTORS = np.array([0.1, 1.0, 10.0, 100.0])
"""Steps tried at once, as multiples of the current damping."""

MOST_DAMPING = 1e6


@dataclass(frozen=True, eq=False)
class Refined:
    """Where each start ended: `points` (m, d), mean squared residuals `costs` (m,), `evaluations` spent."""

    points: Array
    costs: Array
    evaluations: int

    @property
    def best(self) -> int:
        """The index of the least cost."""
        return int(np.argmin(self.costs))


@dataclass
class _Descent:
    """One start's progress; lives only inside `refine`."""

    point: Array
    residual: Array
    cost: float
    damping: float = 1e-2
    done: bool = False


def refine(
    simulate: Simulate,
    recorded: Array,
    starts: Array,
    box: Box,
    *,
    step: float = 2e-3,
    iterations: int = 12,
    tolerance: float = 1e-4,
    on_iteration: Callable[[int], None] | None = None,
) -> Refined:
    """Minimise the mean squared residual of `simulate` against `recorded` from each of `starts` (m, d).

    Parameters
    ----------
    recorded
        Shape (samples,).
    step
        Finite-difference step: large enough to bridge the kinks of stick-slip, in the unit of a point.
    tolerance
        A start is done when an iteration reduces its cost by less than this fraction.
    on_iteration
        Called with the number of iterations done.
    """
    points = box.project(np.array(starts, float))
    residuals = recorded - simulate(points)
    descents = [
        _Descent(point, residual, float(np.mean(residual**2)))
        for point, residual in zip(points, residuals, strict=True)
    ]
    evaluations = len(points)
    for iteration in range(iterations):
        active = [descent for descent in descents if not descent.done]
        if not active:
            break
        jacobians, spent = jacobian(
            simulate, recorded, _points(active), [d.residual for d in active], box, step
        )
        trials = np.concatenate([_trials(d, j, box) for d, j in zip(active, jacobians, strict=True)])
        outcomes = recorded - simulate(trials)
        evaluations += spent + len(trials)
        per_start = len(DAMPING_FACTORS)
        for i, descent in enumerate(active):
            mine = slice(i * per_start, (i + 1) * per_start)
            _accept(descent, trials[mine], outcomes[mine], tolerance)
        if on_iteration is not None:
            on_iteration(iteration + 1)
    return Refined(_points(descents), np.array([descent.cost for descent in descents]), evaluations)


def _points(descents: list[_Descent]) -> Array:
    """Return the points of `descents`, shape (m, d)."""
    return np.stack([descent.point for descent in descents])


def jacobian(
    simulate: Simulate, recorded: Array, points: Array, residuals: list[Array], box: Box, step: float
) -> tuple[Array, int]:
    """Return the derivatives of `simulate` at `points` (m, d), and the simulations spent.

    The derivatives have shape (m, d, samples): one-sided differences, taken inward where a bound is
    near. `residuals` are those at the points.
    """
    m, d = points.shape
    forward = points[:, np.newaxis, :] + step * np.eye(d)
    # Rounding alone may put a point on a bound beside it.
    inside = np.all(np.abs(box.project(forward) - forward) < 1e-6 * step, axis=2)
    moved = np.where(inside[:, :, np.newaxis], forward, points[:, np.newaxis, :] - step * np.eye(d))
    moved = box.project(moved)
    steps = np.einsum("mii->mi", moved - points[:, np.newaxis, :])
    outputs = simulate(moved.reshape(m * d, d)).reshape(m, d, -1)
    at_points = np.stack([recorded - residual for residual in residuals])
    return (outputs - at_points[:, np.newaxis, :]) / steps[:, :, np.newaxis], m * d


def sensitivity(simulate: Simulate, point: Array, box: Box, moves: Array) -> tuple[Array, int]:
    """Return the derivatives of `simulate` at `point` (d,), shape (d, rows), and the simulations spent.

    Differences over both sides of the point along each of `moves` (d, d), as far as the bounds allow: on
    one side alone, a kink of stick-slip looks like information.
    """
    d = point.size
    sides = box.project(np.concatenate([point + moves, point - moves]))
    outputs = simulate(sides)
    # At a bound a move is cut short, and near a curved one bent: what was moved is what counts.
    inverse = np.linalg.pinv(sides[:d] - sides[d:], rcond=1e-9)
    # So small a product takes longer in the threads of a library than without.
    return np.einsum("ij,jr->ir", inverse, outputs[:d] - outputs[d:]), 2 * d


def scattered(
    simulate: Simulate, point: Array, box: Box, step: float, count: int, seed: int
) -> tuple[Array, int]:
    """Return `count` sensitivities (count, d, rows), and the simulations spent.

    Each over differences of `step` and about a point of its own, about as far from `point` (d,): noise
    from kinks differs between them.
    """
    rng = generator(seed, 1)
    moves = step * np.eye(point.size)
    derivatives = []
    for _ in range(count):
        beside = box.project(point + rng.normal(0.0, step, point.size))
        derivatives.append(sensitivity(simulate, beside, box, moves)[0])
    return np.array(derivatives), 2 * count * point.size


def information(derivatives: Array) -> Array:
    """Return the normal matrix (d, d) of several `derivatives` (n, d, rows), free of the bias of their noise.

    The kinks of stick-slip make noise of derivatives, and the square of noise looks like information: on
    what the data do not tell, it may be all there is. Products of derivatives taken at different points
    have no such bias, so the mean is over all pairs; a single one (n = 1) is taken as it is.
    """
    count = len(derivatives)
    squares: Array = sum(one @ one.T for one in derivatives)
    total = derivatives.sum(axis=0)
    pairs = (total @ total.T - squares) / (count * (count - 1)) if count > 1 else squares
    values, axes = np.linalg.eigh((pairs + pairs.T) / 2)
    return np.asarray(axes * np.maximum(values, 0.0) @ axes.T)


def movable(point: Array, gradient: Array, box: Box) -> NDArray[np.intp]:
    """Return the indices of the components of `point` (d,) that no bound keeps from following `gradient`."""
    at_lower = (point <= box.lower) & (gradient < 0)
    at_upper = (point >= box.upper) & (gradient > 0)
    return np.flatnonzero(~(at_lower | at_upper))


def _trials(descent: _Descent, derivatives: Array, box: Box) -> Array:
    """Return the points that damped Gauss-Newton steps lead to, one for each damping factor."""
    normal = derivatives @ derivatives.T
    gradient = derivatives @ descent.residual
    free = movable(descent.point, gradient, box)
    trials = np.tile(descent.point, (len(DAMPING_FACTORS), 1))
    if free.size:
        normal = normal[np.ix_(free, free)]
        scale = np.diag(normal).copy()
        # A component without effect would otherwise leave the equations singular.
        scale = np.maximum(scale, 1e-9 * max(scale.max(), np.finfo(float).tiny))
        for row, factor in enumerate(DAMPING_FACTORS):
            damped = normal + np.diag(descent.damping * factor * scale)
            trials[row, free] += np.linalg.solve(damped, gradient[free])
    return box.project(trials)


def _accept(descent: _Descent, trials: Array, residuals: Array, tolerance: float) -> None:
    """Move `descent` to its best trial, or raise its damping if none is better."""
    costs = np.mean(residuals**2, axis=1)
    best = int(np.argmin(costs))
    if costs[best] < descent.cost:
        descent.done = costs[best] > (1 - tolerance) * descent.cost
        descent.point, descent.residual, descent.cost = trials[best], residuals[best], float(costs[best])
        descent.damping = max(descent.damping * DAMPING_FACTORS[best], 1e-9)
    else:
        descent.damping *= 10 * DAMPING_FACTORS[-1]
        descent.done = descent.damping > MOST_DAMPING
