"""The global search: many points, then damped least squares from the best of them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
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
"""Points of the global stage where no optimiser makes it."""


COARSE = LeastSquaresSettings(step=1e-2, iterations=8, least_gain=3e-2)
FINE = LeastSquaresSettings(step=2e-3, iterations=12, least_gain=1e-2)
"""Coarse steps of differences bridge the kinks that stick-slip and heavy shorts make; fine ones settle
between them. The least gain of an iteration is what switching makes of a misfit."""


@dataclass(frozen=True)
class MultistartSettings:
    """How starts are chosen and refined; `emaphm study run hybrids` compares.

    `smooth_starts` of the points are best with the signals through a low-pass, `sharp_starts` without:
    where it is not needed, it ends a little farther off. Two starts are `start_separation` apart at least: a
    population gathers, and one start from each gathering is enough.
    """

    smooth_starts: int = 3
    sharp_starts: int = 2
    start_separation: float = 0.2
    coarse: LeastSquaresSettings = COARSE
    fine: LeastSquaresSettings = FINE


MULTISTART = MultistartSettings()


@dataclass(frozen=True)
class LocalSearchSettings:
    """Descents from an estimate and from perturbed candidates near it.

    A descent is held by the kinks of stick-slip, in whichever happens to lie in its way; of several, from
    `candidate_separation` apart (rms of each coordinate), some are not.
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
    """Return where damped least squares lead from the best starts.

    `optimizer`, made from lower and upper bounds, finds the starts; without one they are the best of
    `GLOBAL_POINTS` space-filling points.
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
    """Return where coarse and then fine descents lead from `starts` (n, d), which are near the optimum."""
    coarse = _descend(objective, objective.space.project(starts), MULTISTART.coarse, False)
    return _descend(objective, coarse.points, MULTISTART.fine, False)


def local_search(
    objective: MapObjective,
    point: Array,
    correction: Array | float,
    rng: np.random.Generator,
    settings: LocalSearchSettings = LOCAL_SEARCH,
) -> LeastSquaresResult:
    """Return where fine descents lead from `point` (d,) and from perturbed candidates near it.

    `correction`, shape (rows,), is added to the model's outputs.
    """
    perturbation = rng.normal(0.0, settings.candidate_separation, (settings.descents - 1, point.size))
    starts = objective.space.project(np.vstack([point, point + perturbation]))
    return descents_from(objective, starts, correction)


def descents_from(objective: MapObjective, starts: Array, correction: Array | float) -> LeastSquaresResult:
    """Return where fine descents lead from each of `starts` (n, d), under a `correction` (rows,)."""
    return _descend(objective, starts, MULTISTART.fine, False, correction)


def with_descents(count: int) -> LocalSearchSettings:
    """Return the local search with another number of descents."""
    return replace(LOCAL_SEARCH, descents=count)


def _global_stage(
    objective: MapObjective, seed: int, optimizer: Callable[..., Any] | None
) -> tuple[Array, Array, Array]:
    """Return all points tried (n, d), and their costs (n,) by the smoothed and the full primary channel."""
    d = objective.space.dimensions
    lower, upper = np.zeros(d), np.ones(d)
    points: list[Array] = []
    sharp: list[Array] = []
    smooth: list[Array] = []

    def cost(unit: Array) -> Array:
        points.append(objective.space.prior_transform(unit))
        residuals = objective.problem.recorded - objective.primary_outputs(points[-1])
        with np.errstate(over="ignore"):  # a model that a law carries away is a bad start
            sharp.append(np.mean(residuals**2, axis=1))
            smooth.append(np.mean(low_pass(objective, residuals) ** 2, axis=1))
        return smooth[-1]

    if optimizer is None:
        cost(space_filling(GLOBAL_POINTS, lower, upper, seed))
    else:
        optimizer(lower, upper).minimise(cost, seed)
    return np.concatenate(points), np.concatenate(smooth), np.concatenate(sharp)


def _separate_best(points: Array, costs: Array, count: int, separation: float) -> Array:
    """Return up to `count` of the best of `points` (n, d), none within `separation` of a better one."""
    chosen: list[Array] = []
    for i in np.argsort(costs, kind="stable"):
        if all(np.linalg.norm(points[i] - other) > separation for other in chosen):
            chosen.append(points[i])
        if len(chosen) == count:
            break
    return np.array(chosen)


def _stage_progress(
    on_progress: Progress | None, done: int, stage: LeastSquaresSettings
) -> Callable[[int], None] | None:
    """Return what reports the progress within one of the three descents, after `done` of them."""
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
    def seen(outputs: Array) -> Array:
        return low_pass(objective, outputs) if smoothed else outputs

    # The correction is subtracted from the target once instead of added to every output.
    target = seen(objective.target - correction)
    return least_squares(
        lambda points: seen(objective.outputs(points)),
        target,
        starts,
        objective.space,
        settings,
        on_iteration,
    )
