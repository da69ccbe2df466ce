"""Repeated searches, where one leaves more than noise and switching explain."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import compared, correct_bias
from emaphm.estimation.correction_iterations import BIAS_CORRECTION, FROM_STARTS, never
from emaphm.estimation.discrepancy import REFERENCE_RUNS, reference_problem
from emaphm.estimation.global_search.heavy_current import is_heavy, leaves_switching_alone
from emaphm.estimation.global_search.multistart import descend_from, multistart
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.reference.ensemble import refine_by_ensemble
from emaphm.estimation.reference.refinement import refine_by_reference
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.progress import Progress, subprogress
from emaphm.random_streams import child_seed, stream

MAX_RESTARTS = 3
"""Most further searches."""

MOST_STARTS = 2
"""Ends of descents that a correction begins at, as many as after a global search."""

SAME_POINT = 0.02
"""Difference of every coordinate below which two searches have ended at the same point."""


def search_with_restarts(
    objective: MapObjective,
    settings: SearchSettings,
    on_progress: Progress | None,
    starts: Array | None = None,
    is_hopeless: Callable[[SearchResult], bool] = never,
) -> SearchResult:
    """Return the best of several searches, each a global search and its bias correction.

    Restart at most `MAX_RESTARTS` times while the residual exceeds noise and switching; stop once two
    searches agree. The other ends are the result's alternatives. With `starts` (n, d), the first search is
    one from there, and no other follows where it leaves no more than noise and switching. The first search of
    all is also the last, its end as it is, where that `is_hopeless`.
    """
    ends: list[SearchResult] = []
    if starts is not None:
        points = objective.space.project(starts)
        if is_heavy(objective.problem):
            ends.append(_heavy_from_starts(objective, points, settings.seed, on_progress))
        else:
            ends.append(_from_starts(objective, points, settings, on_progress))
        if _reaches_noise(ends[0]):
            return ends[0]
    for search in range(1 + MAX_RESTARTS):
        child = settings.child("restart", search - 1) if search else settings
        other = _search(objective, child, None if search else on_progress)
        agree = bool(ends) and _alike(other, _best(ends))
        ends.append(other)
        if not search and is_hopeless(_best(ends)):
            return _best(ends)
        if agree or _reaches_noise(_best(ends)):
            break
    best = _best(ends)
    others = tuple(one for one in ends if one is not best)
    refined = refine_by_reference(best, settings.seed)
    return replace(refined, alternatives=others) if others else refined


def _reaches_noise(result: SearchResult) -> bool:
    """Return whether noise and switching account for what is left: all of it, of a heavy current."""
    if is_heavy(result.objective.problem):
        return leaves_switching_alone(result)
    return result.down_to_noise


def _best(ends: list[SearchResult]) -> SearchResult:
    return min(ends, key=lambda one: one.residual_variance)


def _alike(one: SearchResult, other: SearchResult) -> bool:
    return bool(np.all(np.abs(one.point - other.point) < SAME_POINT))


def _from_starts(
    objective: MapObjective,
    points: Array,
    settings: SearchSettings,
    on_progress: Progress | None,
) -> SearchResult:
    """Return where corrections from `points` lead.

    From one point, on without patience as long as it gets anywhere. Several say that it is not known to a
    few percent where the optimum is: descents from all of them, and a correction as after a global search
    from the best. Such a one also follows a first that is held above noise and switching, and then steps by
    the reference model itself.
    """
    progress = subprogress(on_progress, 0.0, 0.9)
    correction = FROM_STARTS
    if len(points) > 1:
        found = descend_from(objective, points)
        points = found.points[np.argsort(found.costs, kind="stable")[:MOST_STARTS]]
        correction = BIAS_CORRECTION
    most, seed = settings.max_corrections, settings.seed
    result = correct_bias(objective, points, most, seed, progress, correction)
    if not result.down_to_noise:
        child = child_seed(seed, "on from the starts")
        onwards = correct_bias(objective, result.point[np.newaxis], most, child)
        result = refine_by_reference(_best([result, onwards]), child)
    return replace(result, started=True)


def _heavy_from_starts(
    objective: MapObjective, points: Array, seed: int, on_progress: Progress | None
) -> SearchResult:
    """Return where an ensemble leads from the best of `points`.

    The averaged model's own optimum is farther off than they are where the current is heavy.
    """
    rng = stream(seed, "reference runs", "starts")
    none, reference = np.zeros_like(objective.target), reference_problem(objective)
    # Each with two runs at least, between which the switching differs.
    parts = np.array_split(points, -(-2 * len(points) // REFERENCE_RUNS))
    known = [one for part in parts for one in compared(objective, none, part, reference, rng)]
    return replace(refine_by_ensemble(_best(known), seed, on_progress), started=True)


def _search(
    objective: MapObjective,
    settings: SearchSettings,
    on_progress: Progress | None = None,
) -> SearchResult:
    """Return where the global search and the corrections after it end."""
    heavy = is_heavy(objective.problem)
    searched, corrected = (0.1, 0.2) if heavy else (0.4, 1.0)
    most, seed, optimizer = settings.max_corrections, settings.seed, settings.method.optimizer
    refined = multistart(objective, seed, optimizer, subprogress(on_progress, 0.0, searched))
    progress = subprogress(on_progress, searched, corrected)
    result = correct_bias(objective, refined.points, most, seed, progress)
    if not heavy:
        return result
    return refine_by_ensemble(result, seed, subprogress(on_progress, corrected, 1.0))
