"""Parameters that deviate from the description although nobody asked to estimate them: a score test.

A wrong inertia reads as a fault wherever it is taken as known, and leaves hardly more residual. But where
the recording has information on it, a Gauss-Newton step leads away from its nominal value (Rao 1948; Engle
1984), and descents from there leave a slightly smaller residual. The nuisance is then estimated with the
faults. It is kept if it is still significant, deviates by more than every actuator does, and the residual is
smaller. Of an inertia (`profile`) and a supply (`supply_scan`) the reference model is asked. Of several that
are kept, the most probable by residual and prior is selected; the others widen the intervals (`rivals`).
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.selection.extension import Candidate, with_nuisances
from emaphm.diagnosis.selection.laws.law_fit import without_law
from emaphm.diagnosis.selection.nuisance_candidates import worthwhile_candidates
from emaphm.diagnosis.selection.profile import PROFILED
from emaphm.diagnosis.selection.residual_share import hopeless_next_to, share_of_residual
from emaphm.diagnosis.selection.ripple import ripple_share
from emaphm.diagnosis.selection.rivals import residual_power, with_rivals
from emaphm.diagnosis.selection.selection import Selection
from emaphm.diagnosis.selection.settings import SELECTION, SENSOR_SELECTION, widening
from emaphm.diagnosis.selection.supply.supply_profile import SUPPLY
from emaphm.diagnosis.selection.supply.supply_scan import is_off, with_supply
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.correction_iterations import never
from emaphm.estimation.discrepancy import resolves_switching
from emaphm.estimation.global_search.multistart import multistart
from emaphm.estimation.objective import CORRELATED_ROWS, MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.sensors.sensor_model import COMMON_DELAY, error_kind, sensor_error
from emaphm.estimation.space.nuisances import usual_deviation
from emaphm.estimation.uncertainty.correlation import longest_correlation
from emaphm.estimation.uncertainty.local_covariance import (
    jacobians_at,
    local_covariance,
    reference_response,
)
from emaphm.estimation.uncertainty.switching_scores import switching_errors, switching_scores
from emaphm.random_streams import child_seed, stream
from emaphm.threads import in_threads


def select_nuisances(result: SearchResult, settings: SearchSettings) -> Selection:
    """Return the result with the significant nuisances estimated too."""
    names: tuple[str, ...] = ()
    while True:
        worthwhile = worthwhile_candidates(result, names, settings.seed)
        result = worthwhile.result
        best = _best(result, worthwhile.candidates, names, settings)
        exceeds = not (result if best is None else best[1]).residual_is_expected
        if exceeds and resolves_switching(result.objective.problem):
            best = _from_afar(result, names, settings) or best
        if best is None:
            return Selection(result, names, look=worthwhile.look)
        result, names = best[1], (*names, best[0])


def _from_afar(
    result: SearchResult, names: tuple[str, ...], settings: SearchSettings
) -> tuple[str, SearchResult] | None:
    """Return the error of sensors with which the residual is expected, and the result with it.

    A delay of several rows reads as another gain, a scale as shorts, a zero as a load: they lead the search
    so far astray that no descent from there finds back. Each is searched for anew, and the `most_corrected`
    that explain most are corrected.
    """
    problem = result.objective.problem
    others = result.objective.space.nuisances.others(problem.actuator, tuple(problem.measured))
    kinds = [name for name in others if name == COMMON_DELAY or error_kind(name) in ("scale", "offset")]
    ends = in_threads(lambda name: _FarEnd.of(result, names, name, settings.seed), kinds, problem.workers)
    least = sorted(ends, key=lambda end: end.cost)[: SENSOR_SELECTION.most_corrected]
    is_hopeless = hopeless_next_to(result)

    def corrected(end: _FarEnd) -> SearchResult | None:
        child = settings.child("nuisance selection from afar", end.name)
        tried = correct_bias(
            end.objective, end.points, child.max_corrections, child.seed, is_hopeless=is_hopeless
        )
        return (
            tried
            if tried.residual_is_expected and _significant(tried, result, end.name, child.seed)
            else None
        )

    tried = in_threads(corrected, least, problem.workers)
    outcomes = [(end.name, one) for end, one in zip(least, tried, strict=True) if one is not None]
    return min(outcomes, key=lambda one: share_of_residual(one[1], result)) if outcomes else None


@dataclass(frozen=True, eq=False)
class _FarEnd:
    """Where a global search with a nuisance ends: its least cost, and points (n, d) of the `objective`."""

    name: str
    cost: float
    objective: MapObjective
    points: Array

    @classmethod
    def of(cls, result: SearchResult, names: tuple[str, ...], name: str, seed: int) -> Self:
        """Return the end of the search with the nuisance `name`, where `names` were selected before."""
        narrow, _ = with_nuisances(result, names, (name,), SENSOR_SELECTION.search_widening)
        wide, _ = with_nuisances(result, names, (name,))
        found = multistart(narrow, child_seed(seed, "search with a nuisance", name))
        points = found.points.copy()
        points[:, wide.space.coordinates.index(name)] *= SENSOR_SELECTION.search_widening / widening(name)
        return cls(name, float(found.costs.min()), wide, points)


def _best(
    result: SearchResult,
    candidates: list[Candidate],
    names: tuple[str, ...],
    settings: SearchSettings,
) -> tuple[str, SearchResult] | None:
    """Return the most probable candidate and its result, None where none is significant.

    `names` were selected before.

    What the other candidates, and none of them, would make of the estimate adds to its scatter.
    """
    kept: list[tuple[str, SearchResult]] = []
    for candidate in candidates:
        if kept and candidate.share > SENSOR_SELECTION.rival_share * candidates[0].share:
            continue
        if not candidate.promising and not any(sensor_error(name) for name, _ in kept):
            continue
        child = settings.child("nuisance selection", candidate.name)
        # A sensor's error has to explain what exceeds the expected residual, or most of it; others need not.
        is_hopeless = hopeless_next_to(result) if sensor_error(candidate.name) else never
        point = candidate.point[np.newaxis]
        tried = correct_bias(
            candidate.objective, point, child.max_corrections, child.seed, is_hopeless=is_hopeless
        )
        if candidate.name == SUPPLY:
            tried = with_supply(tried, names, child)
        if _significant(tried, result, candidate.name, child.seed) and _confirmed(
            tried, result, candidate.name, child
        ):
            kept.append((candidate.name, tried))
    if not kept:
        return None
    before = residual_power(result, result, settings.seed) if len(kept) > 1 else 1.0
    levels = []
    for name, tried in kept:
        share = (
            share_of_residual(tried, result)
            if len(kept) == 1
            else residual_power(tried, result, settings.seed) / before
        )
        levels.append(_improbability(tried, result, name, share))
    first = int(np.argmin(levels))
    name, best = kept[first]
    rivals = [result, *(one for i, (_, one) in enumerate(kept) if i != first)]
    others = np.array([0.0, *np.delete(levels, first)])
    return name, with_rivals(best, rivals, others - levels[first])


def _improbability(tried: SearchResult, before: SearchResult, name: str, share: float) -> float:
    """Return -2 ln of how probable `tried`, with the nuisance `name`, is relative to `before`, without it.

    It leaves `share` of the mean squared residual.

    A likelihood of as many independent rows as there are, `CORRELATED_ROWS` correlated ones to each, and the
    prior of the description: normal for what belongs to the actuator, Cauchy's for errors of sensors, which
    may be of any size. So 5 % of an inertia, described to 5 %, are likelier than 5 % of a voltage's scale,
    described to 1 %, though both leave the same.
    """
    rows = before.objective.compared_rows / CORRELATED_ROWS
    squared = _deviation(tried, name) ** 2
    prior = 2 * np.log1p(squared) if sensor_error(name) else squared
    return float(rows * np.log(share) + prior)


def _confirmed(tried: SearchResult, before: SearchResult, name: str, settings: SearchSettings) -> bool:
    """Return whether a significant estimate of `name` in `tried` is so by the reference model too.

    Its standard error is then that of a recording that answers by the reference model's derivatives: on slow
    motions those of the fitted model are too large by factors. And it leaves less than the search without the
    nuisance from where `tried` ended: the nuisance may only have led it out of a place where it was held.
    """
    if name in tried.objective.space.nuisances.located:
        return True
    response = reference_response(tried, stream(settings.seed, "response of the selected nuisance"))
    if response is not None and not _significant(tried, before, name, settings.seed, response):
        return False
    back = without_law(tried, before, settings)
    better = share_of_residual(back, before) < 1 / SELECTION.equal_share
    return not better or _significant(tried, back, name, settings.seed, response)


def _significant(
    tried: SearchResult, before: SearchResult, name: str, seed: int, response: Array | None = None
) -> bool:
    """Return whether the estimate of `name` in `tried` is kept; `response` as in `_score`."""
    if abs(_deviation(tried, name)) <= SELECTION.least_deviation:
        return False
    if name in tried.objective.space.nuisances.located:
        return is_off(tried) and ripple_share(tried, before, seed) < SELECTION.likely_share
    share, score = share_of_residual(tried, before), _score(tried, name, seed, response)
    equal = 1.0 if sensor_error(name) else SELECTION.equal_share
    significant = (score >= SELECTION.certain_score and share < equal) or (
        (score >= SELECTION.likely_score or name in PROFILED) and share < SELECTION.likely_share
    )
    return significant and (sensor_error(name) is None or _is_of_a_sensor(tried, name, share))


def _deviation(tried: SearchResult, name: str) -> float:
    """Return how far `name` is estimated off nominal, in standard deviations of the description's prior."""
    objective = tried.objective
    value = float(objective.space.nuisance_values(tried.point[np.newaxis])[name][0])
    return value / usual_deviation(objective.problem.actuator, name)


def _is_of_a_sensor(tried: SearchResult, name: str, share: float) -> bool:
    """Return whether an estimated error of a sensor is more than chance and the rows' distance make of it."""
    objective = tried.objective
    if not tried.residual_is_expected and share >= SENSOR_SELECTION.excess_share:
        return False
    together = longest_correlation(tried.residual_by_channel.values())
    if share >= 1 - SENSOR_SELECTION.chance * together / objective.compared_rows:
        return False
    value = float(objective.space.nuisance_values(tried.point[np.newaxis])[name][0])
    least = SENSOR_SELECTION.least_rows * objective.problem.inputs.interval
    return error_kind(name) != "delay" or abs(value) > least


def _score(result: SearchResult, name: str, seed: int, response: Array | None = None) -> float:
    """Return how many standard errors the estimate of `name` is off nominal.

    With the `response` (d, channel rows) of the reference model, the error includes the step that remains by
    it, and of slow motions what switching alone makes of an estimate.
    """
    objective, i = result.objective, result.objective.space.coordinates.index(name)
    jacobians = jacobians_at(objective, result.point, stream(seed, "Jacobians of the selected nuisance"))
    residual = result.residual[: objective.channel_rows]
    hidden: Array | float = 0.0
    if response is not None:
        errors = switching_errors(result, stream(seed, "switching of the selected nuisance"))
        hidden = switching_scores(jacobians.mean(axis=0), errors)
    local = local_covariance(
        objective, result.point, residual, jacobians, hidden_scores=hidden, response=response
    )
    variance = float((local.covariance + result.scatter)[i, i])
    if response is not None:
        variance += float(objective.space.project(result.point + local.step)[i] - result.point[i]) ** 2
    return float(abs(result.point[i]) / variance**0.5)
