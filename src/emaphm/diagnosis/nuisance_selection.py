"""Parameters that deviate from the description although nobody asked to estimate them: a score test.

A wrong inertia reads as a fault wherever it is taken as known, and leaves hardly more residual. But where
the recording has information on it, a Gauss-Newton step leads away from its nominal value (Rao 1948; Engle
1984), and descents from there leave a slightly smaller residual. The nuisance is then estimated with the
faults. It is kept if it is still significant, deviates by more than every actuator does, and the residual is
smaller.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.multistart import local_search, with_descents
from emaphm.estimation.nuisances import PRIORS_PER_UNIT, NuisanceSet, with_wider_priors
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.parameter_space import ParameterSpace
from emaphm.estimation.search_result import SearchResult, default_scatter
from emaphm.estimation.uncertainty.local_covariance import jacobians_at, local_covariance
from emaphm.random_streams import child_seed, stream


@dataclass(frozen=True)
class NuisanceSelectionSettings:
    """When a nuisance is tried, and when it is kept; `make study` (limits, inertia and supply) measures them.

    Tried: a score above `tried_score` standard errors, and descents that leave less than `tried_share` of the
    mean squared residual. Derivatives at a wrong estimate make scores unreliable: 5 % of inertia had 1.6 to 7
    where line voltage was recorded, the actuator as described up to 4. Descents separate them: with 5 % of
    inertia they left 0.998 at most, 0.98 mostly; as described 0.996 and more, but for 1 recording in 100.

    Kept: an estimate `certain_score` standard errors off nominal with a smaller residual, or `likely_score`
    with less than `likely_share` of it. 5 % of inertia, once estimated, left 0.65 to 0.92; the actuator as
    described no less than chance, 0.976. It must also be off by `least_deviation`, a share of its prior's
    standard deviation: less is expected of every actuator.

    The data must determine the nuisance to `informative`, a share of its prior's standard deviation.
    The prior of what is tried is `widening` times as wide: it would otherwise shrink a large deviation.
    """

    tried_score: float = 1.0
    tried_share: float = 0.995
    certain_score: float = 3.0
    likely_score: float = 1.5
    likely_share: float = 0.95
    least_deviation: float = 0.5
    informative: float = 1.0
    widening: float = 4.0
    descents: int = 2


SELECTION = NuisanceSelectionSettings()


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A nuisance, the objective and point (d,) that descents with it lead to, and the share of residual."""

    name: str
    objective: MapObjective
    point: Array
    share: float


def select_nuisances(
    result: SearchResult, max_corrections: int, seed: int
) -> tuple[SearchResult, tuple[str, ...]]:
    """Return the result with the significant nuisances estimated too, and their names."""
    names: tuple[str, ...] = ()
    while True:
        result, candidates = _candidates(result, names, seed)
        for candidate in candidates:
            child = child_seed(seed, "nuisance selection", candidate.name)
            tried = correct_bias(candidate.objective, candidate.point[np.newaxis], max_corrections, child)
            if _significant(tried, result, candidate.name, child):
                result, names = tried, (*names, candidate.name)
                break
        else:
            return result, names


def _significant(tried: SearchResult, before: SearchResult, name: str, seed: int) -> bool:
    """Return whether the estimate of `name` in `tried` is kept."""
    share, score = _share_of_residual(tried, before), _score(tried, name, seed)
    significant = (score >= SELECTION.certain_score and share < 1) or (
        score >= SELECTION.likely_score and share < SELECTION.likely_share
    )
    value = tried.point[tried.objective.space.coordinates.index(name)]
    least = SELECTION.least_deviation / PRIORS_PER_UNIT / SELECTION.widening
    return significant and bool(abs(value) > least)


def _candidates(
    result: SearchResult, names: tuple[str, ...], seed: int
) -> tuple[SearchResult, list[_Candidate]]:
    """Return the nuisances worth trying, of those neither estimated nor known; the most promising first.

    `names` were selected before, and are estimated in `result`, which is returned with its Jacobians.
    """
    objective = result.objective
    problem = objective.problem
    others = objective.space.nuisances.others(problem.actuator, tuple(problem.measured))
    if not others:
        return result, []
    wide, start = with_nuisances(result, names, others)
    jacobians = jacobians_at(wide, start, stream(seed, "Jacobians of the score test", *names))
    candidates = []
    for name in others:
        extended, point = with_nuisances(result, names, (name,))
        # Jacobians were taken for all at once; each is judged as if it alone were estimated too.
        kept = [i for i, other in enumerate(wide.space.coordinates) if other in extended.space.coordinates]
        residual = result.residual[: objective.channel_rows]
        local = local_covariance(extended, point, residual, jacobians[:, kept])
        i = extended.space.coordinates.index(name)
        error = float((local.covariance + default_scatter(point.size))[i, i] ** 0.5)
        score = float(abs(local.step[i])) / error
        informative = SELECTION.informative / PRIORS_PER_UNIT / SELECTION.widening
        if score > SELECTION.tried_score and error < informative:
            candidate = _refit_with(name, extended, point + local.step, result, seed)
            if candidate.share < SELECTION.tried_share:
                candidates.append(candidate)
    own = [i for i, name in enumerate(wide.space.coordinates) if name in objective.space.coordinates]
    known = replace(result, jacobians=jacobians[:, own])
    return known, sorted(candidates, key=lambda candidate: candidate.share)


def _refit_with(
    name: str, objective: MapObjective, start: Array, result: SearchResult, seed: int
) -> _Candidate:
    """Return where descents lead from `start` (d,) under the correction of `result`."""
    rows = result.objective.channel_rows
    correction = np.zeros_like(objective.target)
    correction[:rows] = result.outputs_correction[:rows]
    rng = stream(seed, "descents of the score test", name)
    start = objective.space.project(start)
    point = local_search(objective, start, correction, rng, with_descents(SELECTION.descents)).best
    residual = objective.residual(point, correction)[:rows]
    share = float(np.mean(residual**2) / np.mean(result.residual[:rows] ** 2))
    return _Candidate(name, objective, point, share)


def _share_of_residual(tried: SearchResult, before: SearchResult) -> float:
    """Return the mean squared residual of the channels in `tried`, relative to that in `before`."""
    rows = before.objective.channel_rows
    ratios = before.objective.problem.weights / tried.objective.problem.weights
    residual = tried.residual[:rows] * np.repeat(ratios, before.objective.problem.samples)
    return float(np.mean(residual**2) / np.mean(before.residual[:rows] ** 2))


def _score(result: SearchResult, name: str, seed: int) -> float:
    """Return how many standard errors the estimate of `name` is off nominal."""
    objective, i = result.objective, result.objective.space.coordinates.index(name)
    jacobians = jacobians_at(objective, result.point, stream(seed, "Jacobians of the selected nuisance"))
    residual = result.residual[: objective.channel_rows]
    local = local_covariance(objective, result.point, residual, jacobians)
    return float(abs(result.point[i]) / (local.covariance + result.scatter)[i, i] ** 0.5)


def with_nuisances(
    result: SearchResult, names: tuple[str, ...], more: tuple[str, ...]
) -> tuple[MapObjective, Array]:
    """Return the objective with `more` nuisances, and the point (d,) of `result` in its space.

    They have wide priors, as have `names`, which were selected before.
    """
    objective = result.objective
    actuator, measured = objective.problem.actuator, tuple(objective.problem.measured)
    chosen = (*objective.space.nuisances.chosen, *more)
    wider = with_wider_priors(actuator, (*names, *more), SELECTION.widening)
    space = ParameterSpace.of(
        actuator, NuisanceSet.of(wider, chosen, measured, objective.space.nuisances.unit)
    )
    values = dict(zip(objective.space.coordinates, result.point, strict=True))
    return replace(objective, space=space), np.array([values.get(name, 0.0) for name in space.coordinates])
