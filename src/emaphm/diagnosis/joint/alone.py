"""What each recording of a joint diagnosis asks for by itself.

That gives the starts of the joint fit, the nuisances that deviate significantly in any of the recordings,
and the estimates that are compared for contradictions.
"""

from collections.abc import Sequence

import numpy as np

from emaphm.actuator import Actuator
from emaphm.diagnosis.diagnose import objective_for
from emaphm.diagnosis.identifiability import identifiability
from emaphm.diagnosis.selection.extension import with_nuisances
from emaphm.diagnosis.selection.nuisance_selection import select_nuisances
from emaphm.diagnosis.selection.supply_scan import with_asked_supply
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.joint.objective import JointObjective
from emaphm.estimation.joint.random_effects import random_effects
from emaphm.estimation.joint.uncertainty import AloneEstimates
from emaphm.estimation.methods import method_named
from emaphm.estimation.search import search
from emaphm.estimation.search_result import SearchResult
from emaphm.progress import Progress
from emaphm.random_streams import child_seed
from emaphm.recording import Recording
from emaphm.simulation import AVERAGED

METHOD = "hybrid"
"""How each recording is searched by itself."""


def search_alone(
    recordings: Sequence[Recording],
    actuator: Actuator,
    nuisances: Sequence[str] | None,
    max_corrections: int,
    seed: int,
    workers: int | None,
    on_progress: Progress | None,
) -> tuple[list[SearchResult], tuple[str, ...]]:
    """Return where the search of each recording alone ends, and the nuisances selected in any of them.

    Arguments as of `emaphm.diagnosis.joint.diagnose_joint`.
    """
    method, found = method_named(METHOD), list[tuple[SearchResult, tuple[str, ...]]]()
    for r, recording in enumerate(recordings):
        objective = objective_for(recording, actuator, method, AVERAGED, nuisances, workers)
        # The first one's streams are those of a diagnosis of it alone.
        own = seed if r == 0 else child_seed(seed, "recording", r)
        result = search(objective, method, fitness="least_squares", max_corrections=max_corrections, seed=own)
        if result.discrepancy is not None:
            result = with_asked_supply(result, max_corrections, own)
        asked = nuisances is None and result.discrepancy is not None
        names: tuple[str, ...] = ()
        if asked:
            selection = select_nuisances(result, max_corrections, own)
            result, names = selection.result, selection.names
        found.append((result, names))
        if on_progress:
            on_progress((r + 1) / len(recordings))
    selected = tuple(dict.fromkeys(name for _, names in found for name in names))
    return [_with_all(result, names, selected, max_corrections, seed) for result, names in found], selected


def _with_all(
    result: SearchResult, names: tuple[str, ...], selected: tuple[str, ...], max_corrections: int, seed: int
) -> SearchResult:
    """Return the result with the nuisances `selected` in any recording estimated of this one too."""
    problem, estimated = result.objective.problem, result.objective.space.nuisances
    possible = estimated.others(problem.actuator, tuple(problem.measured))
    more = tuple(name for name in selected if name not in names and name in possible)
    if not more:
        return result
    objective, point = with_nuisances(result, names, more)
    child = child_seed(seed, "nuisances of other recordings")
    return correct_bias(objective, point[np.newaxis], max_corrections, child)


def alone_estimates(alone: Sequence[SearchResult], joint: JointObjective, seed: int) -> AloneEstimates | None:
    """Return what each recording alone asks for; None of one recording."""
    if len(alone) == 1:
        return None
    places = [term.shared_places for term in joint.terms]
    points = np.array([one.point[at] for one, at in zip(alone, places, strict=True)])
    covariances = np.array(
        [identifiability(one, seed).covariance[np.ix_(at, at)] for one, at in zip(alone, places, strict=True)]
    )
    meta = random_effects(points, covariances, joint.prior_deviations[: joint.shared])
    return AloneEstimates(points, covariances, np.ones(len(alone)), meta)
