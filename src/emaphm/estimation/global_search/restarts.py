"""Repetition of a search whose residual exceeds noise and switching."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import compared, correct_bias
from emaphm.estimation.correction_iterations import never
from emaphm.estimation.discrepancy import REFERENCE_RUNS, reference_problem
from emaphm.estimation.global_search.heavy_current import is_heavy, leaves_switching_alone
from emaphm.estimation.global_search.multistart import descend_from, multistart
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.reference.corrected_steps import correct_by_steps
from emaphm.estimation.reference.ensemble import refine_by_ensemble
from emaphm.estimation.reference.refinement import refine_by_reference
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.standstill import command_stands
from emaphm.estimation.uncertainty.local_covariance import moves_slowly
from emaphm.progress import Progress, subprogress
from emaphm.random_streams import child_seed, stream

MAX_RESTARTS = 3
"""Largest number of further searches."""

MOST_STARTS = 2
"""Number of end points of descents from which a correction starts, as after a global search."""

SAME_POINT = 0.02
"""Difference of every coordinate below which two results count as the same point."""


def search_with_restarts(
    objective: MapObjective,
    settings: SearchSettings,
    on_progress: Progress | None,
    starts: Array | None = None,
    is_hopeless: Callable[[SearchResult], bool] = never,
) -> SearchResult:
    """Return the best of several searches, each a global search and its bias correction.

    Restart at most `MAX_RESTARTS` times while the residual exceeds noise and switching; stop when two
    searches agree. All results except the best are its alternatives. With `starts` (n, d), a search from
    these starts comes first, and no search follows if its residual is within noise and switching. If the best
    result after the first global search `is_hopeless`, it is returned without restarts and refinement.
    """
    results: list[SearchResult] = []
    if starts is not None:
        points = objective.space.project(starts)
        if is_heavy(objective.problem):
            results.append(_heavy_from_starts(objective, points, settings.seed, on_progress))
        else:
            results.append(_from_starts(objective, points, settings, on_progress))
        if _reaches_noise(results[0]):
            return results[0]
    for search in range(1 + MAX_RESTARTS):
        child = settings.child("restart", search - 1) if search else settings
        result = _search(objective, child, None if search else on_progress)
        agree = bool(results) and _is_same_point(result, _best(results))
        results.append(result)
        if not search and is_hopeless(_best(results)):
            return _best(results)
        if agree or _reaches_noise(_best(results)):
            break
    best = _best(results)
    alternatives = tuple(result for result in results if result is not best)
    refined = refine_by_reference(best, settings.seed)
    return replace(refined, alternatives=alternatives) if alternatives else refined


def _reaches_noise(result: SearchResult) -> bool:
    """Return whether noise and switching account for the residual; strictly so of a heavy current."""
    if is_heavy(result.objective.problem):
        return leaves_switching_alone(result)
    return result.down_to_noise


def _best(results: list[SearchResult]) -> SearchResult:
    """Return the result of the least residual variance."""
    return min(results, key=lambda result: result.residual_variance)


def _is_same_point(first: SearchResult, second: SearchResult) -> bool:
    """Return whether two searches ended at the same point."""
    return bool(np.all(np.abs(first.point - second.point) < SAME_POINT))


def _from_starts(
    objective: MapObjective,
    points: Array,
    settings: SearchSettings,
    on_progress: Progress | None,
) -> SearchResult:
    """Return the result of corrections from `points` (n, d).

    Several points mean that the optimum is uncertain by more than a few percent: descents from all points
    come first, then a correction from the best, as after a global search. If the residual of the first
    correction exceeds noise and switching, a second correction and steps by the reference model itself
    follow.
    """
    progress = subprogress(on_progress, 0.0, 0.9)
    most, seed = settings.max_corrections, settings.seed
    if len(points) > 1:
        descents = descend_from(objective, points)
        points = descents.points[np.argsort(descents.costs, kind="stable")[:MOST_STARTS]]
        result = correct_bias(objective, points, most, seed, progress)
    else:
        result = _from_one_start(objective, points, settings, progress)
    if not result.down_to_noise:
        child = child_seed(seed, "on from the starts")
        continued = correct_bias(objective, result.point[np.newaxis], most, child)
        result = refine_by_reference(_best([result, continued]), child)
    return replace(result, started=True)


def _from_one_start(
    objective: MapObjective, start: Array, settings: SearchSettings, on_progress: Progress | None
) -> SearchResult:
    """Return the result of a correction from a `start` (1, d) near the optimum.

    Corrected steps need the fewest runs. The iterations of a global search follow if the steps do not
    converge; they replace the steps if the shaft may rest or moves slowly, because a step by the averaged
    model's derivatives may then be many times too short.
    """
    if not (command_stands(objective.problem) or moves_slowly(objective.problem)):
        result = correct_by_steps(objective, start[0], settings.max_corrections, settings.seed)
        if result.converged:
            return result
    return correct_bias(objective, start, settings.max_corrections, settings.seed, on_progress)


def _heavy_from_starts(
    objective: MapObjective, points: Array, seed: int, on_progress: Progress | None
) -> SearchResult:
    """Return the result of an ensemble that starts at the best of `points` (n, d).

    No descent comes first: with a heavy current, the optimum of the averaged model deviates more than the
    starts.
    """
    rng = stream(seed, "reference runs", "starts")
    reference = reference_problem(objective)
    # Each point needs at least two runs with different switching.
    parts = np.array_split(points, -(-2 * len(points) // REFERENCE_RUNS))
    results = [result for part in parts for result in compared(objective, part, reference, rng)]
    return replace(refine_by_ensemble(_best(results), seed, on_progress), started=True)


def _search(objective: MapObjective, settings: SearchSettings, on_progress: Progress | None) -> SearchResult:
    """Return the result of a global search and of the corrections after it."""
    heavy = is_heavy(objective.problem)
    searched, corrected = (0.1, 0.2) if heavy else (0.4, 1.0)
    most, seed, optimizer = settings.max_corrections, settings.seed, settings.method.optimizer
    refined = multistart(objective, seed, optimizer, subprogress(on_progress, 0.0, searched))
    progress = subprogress(on_progress, searched, corrected)
    result = correct_bias(objective, refined.points, most, seed, progress)
    if not heavy:
        return result
    return refine_by_ensemble(result, seed, subprogress(on_progress, corrected, 1.0))
