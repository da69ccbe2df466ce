"""Exploration of the false minima that heavy currents have, by the reference model itself.

Shorts in all phases keep the current at its limit. The averaged model is far off there, and its discrepancy
changes from point to point, so that a bias correction ends in one of many false minima along a curved valley.
What such an end leaves is clearly more than noise and switching, and still little relative to the current:
`SMALLEST_SHARE` lets it pass. From there, points near and far are refined under the present correction, and
the reference model chooses among them; then it is repeated from the best, as long as that leads on.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import compared
from emaphm.estimation.discrepancy import reference_problem
from emaphm.estimation.global_search.multistart import descents_from
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult
from emaphm.random_streams import stream


@dataclass(frozen=True)
class ExplorationSettings:
    """When a result is explored, how, and when that ends.

    A current is heavy from an rms of `heavy` of its limit on: of 40 random vectors with shorts up to 0.7, the
    largest was 0.38, and false minima began at 0.46. A result is clear of doubt where the residual of every
    channel is at most `clear` times noise and switching, and these exceed `SMALLEST_SHARE` of the current: at
    the truth it was 0.93 to 1.13.

    Each iteration refines `moves` points: up to half of them along differences of points that were about as
    good, up to `stretch` times as long; the others off by `near` to `far`, standard deviation of each
    coordinate, even on a logarithmic scale. These and those halfway to them are run once by the reference
    model, the `compared` best several times. Progress is a misfit below `progress` times the one before;
    after `patience` iterations without, or `iterations`, the exploration ends. Misfits up to `equal` times
    the least count as equal: these points are what the recording does not distinguish.
    """

    heavy: float = 0.45
    clear: float = 1.1
    iterations: int = 20
    moves: int = 16
    near: float = 4e-3
    far: float = 0.12
    stretch: tuple[float, float] = (0.3, 2.0)
    compared: int = 4
    progress: float = 0.98
    patience: int = 6
    alike: float = 1.15
    equal: float = 1.05


EXPLORATION = ExplorationSettings()

NEAR_STARTS = ExplorationSettings(patience=2)
"""For an end that leaves noise and switching alone, of a search from points that were near the optimum."""


def is_heavy(problem: Problem, settings: ExplorationSettings = EXPLORATION) -> bool:
    """Return whether the primary channel is a current that is near its limit most of the time."""
    limit = problem.actuator.controller.current_limit
    return problem.primary == "current_A" and bool(
        np.mean(problem.recorded**2) > (settings.heavy * limit) ** 2
    )


def is_clear(result: SearchResult, settings: ExplorationSettings = EXPLORATION) -> bool:
    """Return whether a result is no false minimum that heavy currents hide."""
    if not is_heavy(result.objective.problem, settings):
        return True
    return not result.share_dominates and leaves_switching_alone(result, settings)


def leaves_switching_alone(result: SearchResult, settings: ExplorationSettings = EXPLORATION) -> bool:
    """Return whether noise and switching account for the residual, with no share of the signal."""
    return result.residual_over_switching <= settings.clear


def is_better(one: SearchResult, other: SearchResult) -> bool:
    """Return whether `one` leaves less than `other` in all channels."""
    return _mean_square(one, other) < _mean_square(other, other)


def explore(result: SearchResult, seed: int, settings: ExplorationSettings = EXPLORATION) -> SearchResult:
    """Return the best point that is found near and along the valley of `result`.

    Its scatter is that of the points that fit as well.
    """
    best, idle = result.reweighted(), 0
    reference = reference_problem(best.objective)
    seen = [best]
    for iteration in range(settings.iterations):
        tried = _iteration(best, seen, reference, seed, iteration, settings)
        promising = min(tried, key=lambda one: _misfit(one, best))
        share = 1.0
        if _misfit(promising, best) < _misfit(best, best):
            # Of a few runs, one may look better than it is.
            rng = stream(seed, "confirmation of the exploration", iteration)
            confirmed = _compared(best.objective, promising.point[np.newaxis], reference, rng)[0]
            tried[tried.index(promising)] = confirmed
            share = _mean_square(confirmed, best) / _mean_square(best, best)
            if share < 1:
                best = confirmed.reweighted()
        seen += tried
        idle = 0 if share < settings.progress else idle + 1
        if idle == settings.patience:
            break
    return _with_scatter(best, seen, settings)


def _misfit(one: SearchResult, like: SearchResult) -> float:
    """Return the misfit of `one`, its rows weighted as those of `like`."""
    return one.weighted_as(like.objective).misfit


def _mean_square(one: SearchResult, like: SearchResult) -> float:
    """Return the mean squared residual of `one`, its rows weighted as those of `like`.

    For results of as many runs each: the misfit, less the discrepancy's own error, prefers points at which
    the runs differ.
    """
    return float(np.mean(one.weighted_as(like.objective).residual ** 2))


def reference_costs(objective: MapObjective, points: Array, reference: Problem | None = None) -> Array:
    """Return the mean squared residual (n,) of one run of the reference model at each of `points` (n, d).

    `reference` is its problem, from `reference_problem`, where that is known.
    """
    other = (reference or reference_problem(objective)).like(objective.problem)
    outputs = replace(objective, problem=other).outputs(points)
    return np.asarray(np.mean((objective.target - outputs) ** 2, axis=1))


def _iteration(
    best: SearchResult,
    seen: list[SearchResult],
    reference: Problem,
    seed: int,
    iteration: int,
    settings: ExplorationSettings,
) -> list[SearchResult]:
    """Return what the reference model makes of the most promising points about `best`."""
    objective, space = best.objective, best.objective.space
    least = _misfit(best, best)
    alike = np.array([one.point for one in seen if _misfit(one, best) <= settings.alike * least])
    moves = _moves(alike, space.dimensions, stream(seed, "exploration", iteration), settings)
    ends = descents_from(objective, space.project(best.point + moves), best.outputs_correction).points
    points = np.vstack([ends, space.project((ends + best.point) / 2)])
    costs = reference_costs(objective, points, reference)
    chosen = points[np.argsort(costs, kind="stable")[: settings.compared]]
    rng = stream(seed, "reference runs of the exploration", iteration)
    return _compared(objective, chosen, reference, rng)


def _compared(
    objective: MapObjective, points: Array, reference: Problem, rng: np.random.Generator
) -> list[SearchResult]:
    """Return results at `points` (n, d) with their discrepancies."""
    return compared(objective, np.zeros_like(objective.target), points, reference, rng)


def _moves(alike: Array, dimensions: int, rng: np.random.Generator, settings: ExplorationSettings) -> Array:
    """Return moves (moves, d): along differences of points that are `alike` (n, d), and in any direction."""
    count = settings.moves
    sizes = settings.near * (settings.far / settings.near) ** rng.random((count, 1))
    moves: Array = sizes * rng.normal(size=(count, dimensions))
    if len(alike) < 3:
        return moves
    half = count // 2
    pairs = np.array([rng.choice(len(alike), 2, replace=False) for _ in range(half)])
    lengths = rng.uniform(*settings.stretch, (half, 1))
    moves[:half] = lengths * (alike[pairs[:, 0]] - alike[pairs[:, 1]])
    moves[:half] += settings.near * rng.normal(size=(half, dimensions))
    return moves


def _with_scatter(
    best: SearchResult, seen: list[SearchResult], settings: ExplorationSettings
) -> SearchResult:
    """Return the best with the scatter about it of all that fit as well."""
    least = _misfit(best, best)
    equal = np.array([one.point for one in seen if _misfit(one, best) <= settings.equal * least])
    away = equal - best.point
    scatter = best.scatter + away.T @ away / max(len(equal) - 1, 1)
    # The discrepancy at the point is the correction under which the point is the optimum.
    return replace(best, correction=best.outputs_correction, scatter=scatter, converged=True)
