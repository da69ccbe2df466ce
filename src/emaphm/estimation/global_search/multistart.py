"""Global search: many points, then damped least squares from the best points."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.global_search.smoothing import low_pass
from emaphm.estimation.levenberg_marquardt import LeastSquaresResult, LeastSquaresSettings, least_squares
from emaphm.estimation.objective import MapObjective
from emaphm.optimizers import space_filling
from emaphm.progress import Progress
from emaphm.random_streams import child_seed

GLOBAL_POINTS = 128
"""Number of points of the global stage without an optimiser."""

COARSE = LeastSquaresSettings(step=1e-2, iterations=8, least_gain=3e-2)
FINE = LeastSquaresSettings(step=2e-3, iterations=12, least_gain=1e-2)
"""Coarse difference steps bridge the kinks of stick-slip and heavy shorts; fine steps converge between the
kinks. The least gain of an iteration corresponds to the effect of switching on a misfit."""


@dataclass(frozen=True)
class MultistartSettings:
    """Settings of the choice and refinement of starts; `emaphm study run hybrids` compares them.

    `smooth_starts` starts are the best points for low-pass filtered signals, `sharp_starts` for unfiltered
    signals: where the filter is not needed, it makes the result slightly less accurate. Two starts are at
    least `start_separation` apart: a population forms clusters, and one start of each cluster is enough.
    """

    smooth_starts: int = 3
    sharp_starts: int = 2
    start_separation: float = 0.2
    coarse: LeastSquaresSettings = COARSE
    fine: LeastSquaresSettings = FINE


MULTISTART = MultistartSettings()


@dataclass(frozen=True)
class LocalSearchSettings:
    """Settings of descents from an estimate and from perturbed candidates near it.

    A descent may stop at a local minimum at a kink of stick-slip. Of several descents from random candidates
    with a standard deviation of `candidate_separation` in each coordinate, some do not.
    """

    descents: int = 4
    candidate_separation: float = 4e-3


LOCAL_SEARCH = LocalSearchSettings()


def multistart(
    objective: MapObjective,
    seed: int,
    optimizer: Callable[..., Any] | None = None,
    on_progress: Progress | None = None,
) -> LeastSquaresResult:
    """Return the result of damped least squares from the best starts.

    `optimizer`, created from lower and upper bounds, finds the starts; without an optimiser they are the best
    of `GLOBAL_POINTS` space-filling points.
    """
    points, smooth, sharp = _global_stage(objective, child_seed(seed, "global stage"), optimizer)
    candidates: list[Array] = []
    for costs, count, smoothed in (
        (smooth, MULTISTART.smooth_starts, True),
        (sharp, MULTISTART.sharp_starts, False),
    ):
        starts = _separate_best(points, costs, count, MULTISTART.start_separation)
        on_iteration = _stage_progress(on_progress, len(candidates), MULTISTART.coarse)
        candidates.append(_descend(objective, starts, MULTISTART.coarse, smoothed, 0.0, on_iteration).best)
    on_iteration = _stage_progress(on_progress, 2, MULTISTART.fine)
    return _descend(objective, np.array(candidates), MULTISTART.fine, False, 0.0, on_iteration)


def descend_from(objective: MapObjective, starts: Array) -> LeastSquaresResult:
    """Return the result of coarse and then fine descents from `starts` (n, d) near the optimum."""
    coarse = _descend(objective, objective.space.project(starts), MULTISTART.coarse, False)
    return _descend(objective, coarse.points, MULTISTART.fine, False)


def local_search(
    objective: MapObjective,
    point: Array,
    correction: Array | float,
    rng: np.random.Generator,
    descents: int = LOCAL_SEARCH.descents,
) -> LeastSquaresResult:
    """Return the result of fine descents from `point` (d,) and from perturbed candidates near it.

    `correction` (rows,) is added to the model's outputs.
    """
    starts = objective.space.project(with_perturbed(point, rng, descents))
    return descents_from(objective, starts, correction)


def with_perturbed(point: Array, rng: np.random.Generator, count: int = LOCAL_SEARCH.descents) -> Array:
    """Return `point` (d,) and perturbed candidates near it, (count, d) in total."""
    perturbation = rng.normal(0.0, LOCAL_SEARCH.candidate_separation, (count - 1, point.size))
    return np.vstack([point, point + perturbation])


def descents_from(objective: MapObjective, starts: Array, correction: Array | float) -> LeastSquaresResult:
    """Return the result of fine descents from each of `starts` (n, d), under a `correction` (rows,)."""
    return _descend(objective, starts, MULTISTART.fine, False, correction)


def _global_stage(
    objective: MapObjective, seed: int, optimizer: Callable[..., Any] | None
) -> tuple[Array, Array, Array]:
    """Return all evaluated points (n, d), and their costs (n,) with and without the low-pass filter."""
    d = objective.space.dimensions
    lower, upper = np.zeros(d), np.ones(d)
    points: list[Array] = []
    sharp: list[Array] = []
    smooth: list[Array] = []

    def cost(unit: Array) -> Array:
        points.append(objective.space.prior_transform(unit))
        residuals = objective.problem.recorded - objective.primary_outputs(points[-1])
        with np.errstate(over="ignore"):  # a point at which the model diverges is a bad start
            sharp.append(np.mean(residuals**2, axis=1))
            smooth.append(np.mean(low_pass(objective, residuals) ** 2, axis=1))
        return smooth[-1]

    if optimizer is None:
        cost(space_filling(GLOBAL_POINTS, lower, upper, seed))
    else:
        optimizer(lower, upper).minimise(cost, seed)
    return np.concatenate(points), np.concatenate(smooth), np.concatenate(sharp)


def _separate_best(points: Array, costs: Array, count: int, separation: float) -> Array:
    """Return up to `count` of the best `points` (n, d), each at least `separation` from all better ones."""
    chosen: list[Array] = []
    for i in np.argsort(costs, kind="stable"):
        if all(np.linalg.norm(points[i] - better) > separation for better in chosen):
            chosen.append(points[i])
        if len(chosen) == count:
            break
    return np.array(chosen)


def _stage_progress(
    on_progress: Progress | None, done: int, stage: LeastSquaresSettings
) -> Callable[[int], None] | None:
    """Return a callback that reports the progress within one of three stages, after `done` stages."""
    if on_progress is None:
        return None
    return lambda iteration: on_progress((done + iteration / stage.iterations) / 3)


def _descend(
    objective: MapObjective,
    starts: Array,
    settings: LeastSquaresSettings,
    smoothed: bool,
    correction: Array | float = 0.0,
    on_iteration: Callable[[int], None] | None = None,
) -> LeastSquaresResult:
    """Return the result of descents from `starts` (n, d), with low-pass filtered channels if `smoothed`."""

    def filtered(outputs: Array) -> Array:
        return low_pass(objective, outputs) if smoothed else outputs

    # The correction is subtracted from the target once instead of added to every output.
    target = filtered(objective.target - correction)
    return least_squares(
        lambda points: filtered(objective.outputs(points)),
        target,
        starts,
        objective.space,
        settings,
        on_iteration,
    )
