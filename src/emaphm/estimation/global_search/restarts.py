"""Repeated searches, where one leaves more than noise and switching explain."""

from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.correction_iterations import BIAS_CORRECTION, FROM_STARTS
from emaphm.estimation.global_search.exploration import (
    EXPLORATION,
    NEAR_STARTS,
    explore,
    is_better,
    is_clear,
    is_heavy,
    leaves_switching_alone,
    reference_costs,
)
from emaphm.estimation.global_search.multistart import descend_from, multistart
from emaphm.estimation.methods import Method
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.reference.refinement import refine_by_reference
from emaphm.estimation.search_result import SearchResult
from emaphm.progress import Progress, subprogress
from emaphm.random_streams import child_seed

MAX_RESTARTS = 3
"""Most further searches."""

MOST_STARTS = 2
"""Ends of descents that a correction begins at, as many as after a global search."""

MOST_EXPLORED = 2
"""Most further searches whose ends are explored."""

SAME_POINT = 0.02
"""Difference of every coordinate below which two searches have ended at the same point."""


def search_with_restarts(
    objective: MapObjective,
    method: Method,
    max_corrections: int,
    seed: int,
    on_progress: Progress | None,
    starts: Array | None = None,
) -> SearchResult:
    """Return the best of several searches, each a global search and its bias correction.

    Restart at most `MAX_RESTARTS` times while the residual exceeds noise and switching; stop once two
    searches agree. An end that a heavy current may hide to be false is explored. The other ends are the
    result's alternatives. With `starts` (n, d), the first search is a correction from there, and no other
    follows where it leaves no more than noise and switching.
    """
    ends: list[SearchResult] = []
    if starts is not None:
        points = objective.space.project(starts)
        ends.append(_from_starts(objective, points, max_corrections, seed, on_progress))
        if ends[0].down_to_noise and is_clear(ends[0]):
            return ends[0]
        if ends[0].down_to_noise and leaves_switching_alone(ends[0]):
            return _explored(objective, method, ends, max_corrections, seed)
    for search in range(1 + MAX_RESTARTS):
        child = child_seed(seed, "restart", search - 1) if search else seed
        other = _search(objective, method, max_corrections, child, None if search else on_progress)
        agree = bool(ends) and _alike(other, _best(ends))
        ends.append(other)
        if agree or _best(ends).down_to_noise:
            break
    return _explored(objective, method, ends, max_corrections, seed)


def _explored(
    objective: MapObjective, method: Method, ends: list[SearchResult], max_corrections: int, seed: int
) -> SearchResult:
    """Return the best of `ends`, refined, with the others as its alternatives.

    Where a heavy current may hide that it is a false minimum, it is explored first; and while it still leaves
    more than noise and switching, so are the ends of up to `MOST_EXPLORED` further searches.
    """
    result = _best(ends)
    others = [one for one in ends if one is not result]
    if not is_clear(result):
        settings = NEAR_STARTS if result.started and leaves_switching_alone(result) else EXPLORATION
        started, result = result.started, explore(result, child_seed(seed, "exploration"), settings)
        for search in range(MOST_EXPLORED):
            if leaves_switching_alone(result):
                break
            child = child_seed(seed, "exploration", search)
            other = explore(_search(objective, method, max_corrections, child), child)
            result, worse = (other, result) if is_better(other, result) else (result, other)
            others.append(worse)
        result = replace(result, started=started)
    refined = refine_by_reference(result, seed)
    return replace(refined, alternatives=tuple(others)) if others else refined


def _best(ends: list[SearchResult]) -> SearchResult:
    return min(ends, key=lambda one: one.residual_variance)


def _alike(one: SearchResult, other: SearchResult) -> bool:
    return bool(np.all(np.abs(one.point - other.point) < SAME_POINT))


def _from_starts(
    objective: MapObjective,
    points: Array,
    max_corrections: int,
    seed: int,
    on_progress: Progress | None,
) -> SearchResult:
    """Return where corrections from `points` lead.

    From one point, on without patience as long as it gets anywhere. Several say that it is not known to a
    few percent where the optimum is: descents from all of them, and a correction as after a global search
    from the best. Such a one also follows a first that is held above noise and switching, and then steps by
    the reference model itself.
    """
    progress = subprogress(on_progress, 0.0, 0.9)
    settings = FROM_STARTS
    if len(points) > 1:
        found = descend_from(objective, points)
        ends, costs = found.points, found.costs
        if is_heavy(objective.problem):
            # There the averaged model's own optimum is farther off than the starts.
            ends = np.vstack([points, ends])
            costs = reference_costs(objective, ends)
        points = ends[np.argsort(costs, kind="stable")[:MOST_STARTS]]
        settings = BIAS_CORRECTION
    result = correct_bias(objective, points, max_corrections, seed, progress, settings)
    if not result.down_to_noise:
        child = child_seed(seed, "on from the starts")
        onwards = correct_bias(objective, result.point[np.newaxis], max_corrections, child)
        result = refine_by_reference(_best([result, onwards]), child)
    return replace(result, started=True)


def _search(
    objective: MapObjective,
    method: Method,
    max_corrections: int,
    seed: int,
    on_progress: Progress | None = None,
) -> SearchResult:
    """Return where the global search and the corrections after it end."""
    refined = multistart(objective, seed, method.optimizer, subprogress(on_progress, 0.0, 0.4))
    return correct_bias(objective, refined.points, max_corrections, seed, subprogress(on_progress, 0.4, 1.0))
