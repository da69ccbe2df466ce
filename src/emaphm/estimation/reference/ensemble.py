"""Gauss-Newton steps from regressions over an ensemble of single runs of the reference model.

With currents near their limit, the corrected averaged model has local minima along curved valleys, because
its discrepancy changes from point to point. The reference model itself has chaotic switching, which hides
derivatives over small differences. An ensemble of runs avoids both problems: its points are drawn from the
covariance of the estimate, which is wide where the data constrain little; a linear regression of the outputs
gives derivatives over these distances; and switching averages out. The resulting step moves the ensemble,
and the regression gives its new covariance, until no step reduces the misfit. Outputs are compared in means
over several rows, because switching changes from row to row and the effect of faults mostly does not.

The method is an iterative ensemble smoother in Levenberg-Marquardt form (Chen and Oliver 2013, Computational
Geosciences 17), and a posterior linearisation (García-Fernández et al. 2015, IEEE Transactions on Signal
Processing 63).
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import compared
from emaphm.estimation.discrepancy import RUN_SEPARATION, reference_problem
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.global_search.smoothing import channel_means
from emaphm.estimation.objective import CORRELATED_ROWS, MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult, default_scatter
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.estimation.uncertainty.fisher_information import information
from emaphm.progress import Progress
from emaphm.random_streams import stream


@dataclass(frozen=True)
class EnsembleSettings:
    """Settings of an ensemble, chosen on heavy shorts with other seeds than those of the studies.

    Each generation adds `size` runs, in opposite pairs. The regression also uses the runs of the last `kept`
    generations that are within `reach` times the squared distances expected of new runs. Runs whose cost is
    more than `outliers` times that of the lower quartile have a smaller weight, because a shaft that may
    stick causes two kinds of runs. Outputs are means over `mean_s` [s].

    Steps are damped by `dampings` times the information of the ensemble's covariance, and their length is at
    most `longest` of its standard deviations (rms). They are compared with the best `samples` of the drawn
    points, by `repeats` runs each; costs up to `equal` times the least cost count as equal. After `patience`
    generations whose cost is not below `progress` times the least cost before, the ensemble has converged.

    The covariance is that of an estimate for which `CORRELATED_ROWS` means count as one observation. A
    generation multiplies its standard deviations by a factor from `narrower` to `wider`, which is reduced if
    the nonlinear part exceeds `curvature` of the cost. The first covariance comes from `first_replicates`
    Jacobians of the averaged model, over differences of `first_step`.
    """

    mean_s: float = 1e-3
    size: int = 40
    generations: int = 40
    kept: int = 6
    reach: float = 2.0
    outliers: float = 2.0
    dampings: tuple[float, ...] = (10.0, 1.0, 0.1)
    longest: float = 3.0
    samples: int = 2
    repeats: int = 4
    equal: float = 1.1
    narrower: float = 0.35
    wider: float = 2.0
    curvature: float = 0.5
    progress: float = 0.95
    patience: int = 4
    first_step: float = 2e-2
    first_replicates: int = 2


ENSEMBLE = EnsembleSettings()

LEAST_REGRESSOR = 1e-9
"""Regularisation of a regression in which bounds make all points equal in a coordinate."""


def refine_by_ensemble(
    result: SearchResult,
    seed: int,
    on_progress: Progress | None = None,
    settings: EnsembleSettings = ENSEMBLE,
) -> SearchResult:
    """Return the optimum of the reference model near `result`, whose discrepancy is known.

    The estimate is the mean of the points of the last generations, between which the reference model finds no
    difference; its scatter is their covariance. If its misfit exceeds that of `result` by more than the
    effect of switching, `result` is returned.
    """
    reference = reference_problem(result.objective)
    result = result.reweighted()
    state = _State.first(result, stream(seed, "first ensemble"), settings)
    equal, least = [state.point], np.inf
    for generation in range(settings.generations):
        state = state.next(reference, stream(seed, "ensemble", generation), settings)
        # Between points of equal cost, the reference model finds no difference.
        equal = [state.point] if state.cost < settings.progress * least else [*equal, state.point]
        least = min(least, state.cost)
        if on_progress:
            on_progress((generation + 1) / settings.generations)
        if len(equal) > settings.patience:
            break
    objective = state.objective
    mean = objective.space.project(np.mean(equal, axis=0))
    rng = stream(seed, "reference runs at the end of the ensemble")
    (end,) = compared(objective, mean[np.newaxis], reference, rng)
    if _mean_square(end, objective) > settings.equal * _mean_square(result, objective):
        return result
    scatter = default_scatter(mean.size)
    if len(equal) > 1:
        scatter = scatter + np.cov(np.array(equal), rowvar=False)
    # With the discrepancy at the point as the correction, the point is the optimum.
    return replace(
        end, correction=end.outputs_correction, scatter=scatter, converged=len(equal) > settings.patience
    )


def _mean_square(result: SearchResult, objective: MapObjective) -> float:
    """Return the mean squared residual of `result`, with the weights of `objective` on its rows."""
    return float(np.mean(result.weighted_as(objective).residual ** 2))


def _draw(space: ParameterSpace, point: Array, factor: Array, count: int, rng: np.random.Generator) -> Array:
    """Return random points (count, d) about `point` (d,), in opposite pairs."""
    offsets = rng.normal(size=(count // 2, point.size)) @ factor.T
    return space.project(point + np.concatenate([offsets, -offsets]))


def _farthest_of_equals(costs: Array, steps: int, equal: float) -> int:
    """Return the index of the longest of the first `steps` with a cost equal to the least, or the least."""
    least = int(np.argmin(costs))
    equal_steps = np.flatnonzero(costs[:steps] <= equal * costs[least])
    return int(equal_steps[-1]) if equal_steps.size else least


def first_factor(information: Array, deviations: Array) -> Array:
    """Return F (d, d) of the covariance F Fᵀ from an `information` (d, d) and a prior's `deviations` (d,).

    It is computed along the axes of the information in units of the prior: the inverse of the sum could be
    indefinite by rounding if some directions have 1e8 times the information of others.
    """
    values, axes = np.linalg.eigh(information * np.outer(deviations, deviations))
    return np.asarray(deviations[:, np.newaxis] * axes / np.sqrt(1 + np.maximum(values, 0.0)))


@dataclass(frozen=True, eq=False)
class _State:
    """State of an ensemble: its centre `point` (d,), and its covariance F Fᵀ with F the `factor` (d, d).

    `residual` (rows,) is the mean residual of several runs at the point, with the weights of `objective`;
    `cost` is the mean square of single runs. `ensemble` contains the last runs, None before the first
    generation.
    """

    objective: MapObjective
    point: Array
    factor: Array
    residual: Array
    cost: float
    ensemble: "_Ensemble | None" = None

    @classmethod
    def first(cls, result: SearchResult, rng: np.random.Generator, settings: EnsembleSettings) -> Self:
        """Return the state at `result`, with the covariance of the averaged model for the current misfit."""
        objective, point, residual = result.objective, result.point, result.residual
        jacobians = replicated_jacobians(
            objective.outputs, point, objective.space, settings.first_step, settings.first_replicates, rng
        )
        cost = float(np.mean(residual**2))
        factor = first_factor(
            information(jacobians) / (CORRELATED_ROWS * cost), objective.space.prior_deviations
        )
        return cls(objective, point, factor, residual, cost)

    def next(self, reference: Problem, rng: np.random.Generator, settings: EnsembleSettings) -> "_State":
        """Return the state after one generation."""
        objective, space = self.objective.reweighted(self.residual), self.objective.space
        rows = _Rows.of(objective, reference, settings)
        drawn = _draw(space, self.point, self.factor, settings.size, rng)
        latest = ensemble = _Ensemble(drawn, rows.of_runs(drawn))
        if self.ensemble is not None:
            kept = self.ensemble.rescaled(rows, self.objective)
            ensemble = kept.extended(latest, (settings.kept - 1) * settings.size)
        regression = _Regression.of(ensemble, rows.target, self.point, self.factor, settings)
        unit = CORRELATED_ROWS * rows.cost(objective.rescaled(self.residual, self.objective))
        steps = [regression.step(space, damping * unit, settings) for damping in settings.dampings]
        best = np.argsort(latest.costs(rows.target), kind="stable")[: settings.samples]
        candidates = np.vstack([self.point, *steps, drawn[best]])
        costs, residuals, switching = rows.compared(candidates, settings.repeats, rng)
        chosen = _farthest_of_equals(costs, 1 + len(steps), settings.equal)
        cost = float(costs[chosen])
        factor = regression.next_factor(cost, switching, settings)
        return _State(objective, candidates[chosen], factor, residuals[chosen], cost, ensemble)


@dataclass(frozen=True, eq=False)
class _Rows:
    """An objective of the reference model, with channels in means of `count` rows."""

    objective: MapObjective
    count: int

    @classmethod
    def of(cls, objective: MapObjective, reference: Problem, settings: EnsembleSettings) -> Self:
        """Return the rows of `objective` for the `reference` model."""
        inputs = objective.problem.inputs
        count = int(np.clip(settings.mean_s / inputs.interval * (1 + 1e-9), 1, inputs.samples))
        return cls(replace(objective, problem=reference.like(objective.problem)), count)

    def averaged(self, outputs: Array) -> Array:
        """Return `outputs` (…, rows) in means, scaled so that a white residual keeps its size, (…, k)."""
        channels = self.objective.channel_rows
        means = self.count**0.5 * channel_means(self.objective, outputs, self.count)
        return np.concatenate([means.reshape(*means.shape[:-2], -1), outputs[..., channels:]], axis=-1)

    @property
    def target(self) -> Array:
        """The target of the averaged outputs, (k,)."""
        return self.averaged(self.objective.target)

    def of_runs(self, points: Array) -> Array:
        """Return the averaged outputs (n, k) of one run at each of `points` (n, d)."""
        return self.averaged(self.objective.outputs(points))

    def cost(self, residual: Array) -> float:
        """Return the mean square of the averaged `residual` (rows,)."""
        return float(np.mean(self.averaged(residual) ** 2))

    def compared(self, points: Array, repeats: int, rng: np.random.Generator) -> tuple[Array, Array, float]:
        """Return costs (n,) of single runs at `points` (n, d), and their mean residuals (n, rows).

        The third value is the least variance of a run due to switching, over the points.
        """
        n, d = points.shape
        near = np.repeat(points, repeats, axis=0) + rng.normal(0.0, RUN_SEPARATION, (n * repeats, d))
        outputs = self.objective.outputs(self.objective.space.project(near)).reshape(n, repeats, -1)
        residuals = self.objective.target - outputs
        means = self.averaged(residuals)
        variances = means.var(axis=1, ddof=1).mean(axis=1)
        # Costs of single runs, not of their mean: if a shaft may stick, runs differ by more than switching.
        return np.mean(means**2, axis=(1, 2)), residuals.mean(axis=1), float(variances.min())


@dataclass(frozen=True, eq=False)
class _Ensemble:
    """`points` (n, d), and the averaged `outputs` (n, k) of one run at each point."""

    points: Array
    outputs: Array

    def rescaled(self, rows: _Rows, before: MapObjective) -> "_Ensemble":
        """Return the ensemble with the weights of the objective of `rows`; it has the weights of `before`."""
        ones = np.ones_like(rows.objective.target)
        ratios = rows.averaged(rows.objective.rescaled(ones, before)) / rows.averaged(ones)
        return _Ensemble(self.points, self.outputs * ratios)

    def extended(self, other: "_Ensemble", most: int) -> "_Ensemble":
        """Return the last `most` points of this ensemble, followed by the points of the `other` ensemble."""
        points, outputs = (self.points[-most:], other.points), (self.outputs[-most:], other.outputs)
        return _Ensemble(np.concatenate(points), np.concatenate(outputs))

    def costs(self, target: Array) -> Array:
        """Return the mean squared residual of each run, (n,)."""
        return np.asarray(np.mean((target - self.outputs) ** 2, axis=1))


@dataclass(frozen=True, eq=False)
class _Regression:
    """A linear model of the outputs about `point` (d,), in units of the ensemble's `factor` (d, d).

    `information` (d, d) does not have the bias from the scatter of the runs; `gradient` (d,) points towards
    the target; `variance` is that of a run about the linear model.
    """

    point: Array
    factor: Array
    information: Array
    gradient: Array
    variance: float

    @classmethod
    def of(
        cls, ensemble: _Ensemble, target: Array, point: Array, factor: Array, settings: EnsembleSettings
    ) -> Self:
        """Return the regression over the last generation's runs and all earlier runs near `point`."""
        d = point.size
        units = np.linalg.solve(factor, (ensemble.points - point).T).T
        # Squared distances have the mean d and the variance 2 d.
        near = np.sum(units**2, axis=1) <= settings.reach * (d + 3 * (2 * d) ** 0.5)
        near[-settings.size :] = True
        units, outputs = units[near], ensemble.outputs[near]
        costs = np.mean((target - outputs) ** 2, axis=1)
        usual = settings.outliers * np.quantile(costs[-settings.size :], 0.25)
        weights = np.sqrt(np.minimum(1.0, usual / costs))[:, np.newaxis]
        regressors = weights * np.concatenate([np.ones((len(units), 1)), units], axis=1)
        scatter = np.linalg.inv(regressors.T @ regressors + LEAST_REGRESSOR * np.eye(d + 1))
        coefficients = scatter @ (regressors.T @ (weights * outputs))
        residuals = weights * outputs - regressors @ coefficients
        variance = float(np.sum(residuals**2)) / max(len(units) - d - 1, 1) / target.size
        slopes = coefficients[1:]
        values, axes = np.linalg.eigh(slopes @ slopes.T - target.size * variance * scatter[1:, 1:])
        return cls(
            point,
            factor,
            (axes * np.maximum(values, 0.0)) @ axes.T,
            slopes @ (target - coefficients[0]),
            variance,
        )

    def step(self, space: ParameterSpace, damping: float, settings: EnsembleSettings) -> Array:
        """Return the end point of a damped Gauss-Newton step; coordinates that reach a bound stay there."""
        inverse = np.linalg.inv(self.factor)
        normal = inverse.T @ (self.information + damping * np.eye(self.point.size)) @ inverse
        gradient = inverse.T @ self.gradient
        move, free = np.zeros(self.point.size), np.ones(self.point.size, bool)
        while free.any():
            remaining = gradient - normal[:, ~free] @ move[~free]
            move[free] = np.linalg.solve(normal[np.ix_(free, free)], remaining[free])
            clipped = np.clip(self.point + move, space.lower, space.upper) - self.point
            at_bound = free & (np.abs(clipped - move) > 1e-12)
            if not at_bound.any():
                break
            move[at_bound] = clipped[at_bound]
            free &= ~at_bound
        length = float(np.sqrt(np.mean((inverse @ move) ** 2)))
        return space.project(self.point + move * min(1.0, settings.longest / max(length, settings.longest)))

    def next_factor(self, cost: float, switching: float, settings: EnsembleSettings) -> Array:
        """Return the factor (d, d) of the next ensemble, about a point with this `cost`.

        `switching` is the variance of a run due to switching.
        """
        values, axes = np.linalg.eigh(self.information)
        variances = 1 / (values / (CORRELATED_ROWS * cost) + settings.wider**-2)
        variances = np.maximum(variances, settings.narrower**2)
        nonlinear = self.variance - switching
        if nonlinear > settings.curvature * cost:
            # The nonlinear part is proportional to the fourth power of the standard deviations.
            variances *= max((settings.curvature * cost / nonlinear) ** 0.5, settings.narrower**2)
        return np.asarray(self.factor @ (axes * np.sqrt(variances)))
