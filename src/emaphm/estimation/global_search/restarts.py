"""Repeated searches, where one leaves more than noise and switching explain."""

from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.correction_iterations import FROM_STARTS
from emaphm.estimation.global_search.multistart import multistart
from emaphm.estimation.methods import Method
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.reference.refinement import refine_by_reference
from emaphm.estimation.search_result import SearchResult
from emaphm.progress import Progress, subprogress
from emaphm.random_streams import child_seed

MAX_RESTARTS = 3
"""Most further searches."""

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
    searches agree. The other ends are the result's alternatives. With `starts` (n, d), the first search is a
    correction from there; its end is kept where it leaves no more than noise and switching.
    """
    if starts is not None:
        points = objective.space.project(starts)
        result = correct_bias(
            objective, points, max_corrections, seed, subprogress(on_progress, 0.0, 0.9), FROM_STARTS
        )
        if result.down_to_noise:
            return replace(result, started=True)
    result = _search(objective, method, max_corrections, seed, on_progress)
    ends = [result]
    for restart in range(MAX_RESTARTS):
        if result.down_to_noise:
            break
        other = _search(objective, method, max_corrections, child_seed(seed, "restart", restart))
        ends.append(other)
        agree = bool(np.all(np.abs(other.point - result.point) < SAME_POINT))
        if other.residual_variance < result.residual_variance:
            result = other
        if agree:
            break
    others = tuple(one for one in ends if one is not result)
    refined = refine_by_reference(result, seed)
    return replace(refined, alternatives=others) if others else refined


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
