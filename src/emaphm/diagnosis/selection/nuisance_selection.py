"""Parameters that deviate from the description although nobody asked to estimate them: a score test.

A wrong inertia that is taken as known appears as a fault, with hardly any larger residual. If the recording
has information on the inertia, a Gauss-Newton step leads away from its nominal value (Rao 1948; Engle 1984),
and descents from there end at a slightly smaller residual. The nuisance is then estimated with the faults. It
is kept if it is still significant, deviates by more than is usual for any actuator, and the residual is
smaller. Inertia (`profile`) and supply (`supply_scan`) are tested by the reference model. Of several kept
nuisances, the most probable one by residual and prior is selected; the others widen the intervals (`rivals`).
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.selection.extension import Candidate, with_nuisances
from emaphm.diagnosis.selection.laws.law_fit import without_law
from emaphm.diagnosis.selection.nuisance_candidates import worthwhile_candidates
from emaphm.diagnosis.selection.profile import PROFILED
from emaphm.diagnosis.selection.residual_share import hopelessness_relative_to, share_of_residual
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
    """Return the result with the significant nuisances estimated, and their names."""
    names: tuple[str, ...] = ()
    while True:
        worthwhile = worthwhile_candidates(result, names, settings.seed)
        result = worthwhile.result
        best = _best_candidate(result, worthwhile.candidates, names, settings)
        exceeds_expected = not (result if best is None else best[1]).residual_is_expected
        if exceeds_expected and resolves_switching(result.objective.problem):
            best = _by_global_search(result, names, settings) or best
        if best is None:
            return Selection(result, names, look=worthwhile.look)
        result, names = best[1], (*names, best[0])


def _by_global_search(
    result: SearchResult, names: tuple[str, ...], settings: SearchSettings
) -> tuple[str, SearchResult] | None:
    """Return the sensor error with which the residual is expected, and the result with it; None if none is.

    A delay of several rows appears as another gain, a scale as shorts, a zero error as a load: the estimate
    is then so wrong that descents from it do not find the error. Each error is therefore tested by a new
    global search, and the `most_corrected` errors with the smallest residuals are corrected.
    """
    problem = result.objective.problem
    possible = result.objective.space.nuisances.others(problem.actuator, tuple(problem.measured))
    errors = [name for name in possible if name == COMMON_DELAY or error_kind(name) in ("scale", "offset")]
    ends = in_threads(lambda name: _FarEnd.of(result, names, name, settings.seed), errors, problem.workers)
    best_ends = sorted(ends, key=lambda end: end.cost)[: SENSOR_SELECTION.most_corrected]
    is_hopeless = hopelessness_relative_to(result)

    def corrected_result(end: _FarEnd) -> SearchResult | None:
        child = settings.child("nuisance selection from afar", end.name)
        tried = correct_bias(
            end.objective, end.points, child.max_corrections, child.seed, is_hopeless=is_hopeless
        )
        return (
            tried
            if tried.residual_is_expected and _is_significant(tried, result, end.name, child.seed)
            else None
        )

    tried = in_threads(corrected_result, best_ends, problem.workers)
    outcomes = [
        (end.name, outcome) for end, outcome in zip(best_ends, tried, strict=True) if outcome is not None
    ]
    return min(outcomes, key=lambda outcome: share_of_residual(outcome[1], result)) if outcomes else None


@dataclass(frozen=True, eq=False)
class _FarEnd:
    """Result of a global search with a nuisance: the smallest cost, and points (n, d) of the `objective`."""

    name: str
    cost: float
    objective: MapObjective
    points: Array

    @classmethod
    def of(cls, result: SearchResult, names: tuple[str, ...], name: str, seed: int) -> Self:
        """Return the result of the search with the nuisance `name`; `names` were selected before."""
        narrow, _ = with_nuisances(result, names, (name,), SENSOR_SELECTION.search_widening)
        wide, _ = with_nuisances(result, names, (name,))
        search_result = multistart(narrow, child_seed(seed, "search with a nuisance", name))
        points = search_result.points.copy()
        points[:, wide.space.coordinates.index(name)] *= SENSOR_SELECTION.search_widening / widening(name)
        return cls(name, float(search_result.costs.min()), wide, points)


def _best_candidate(
    result: SearchResult,
    candidates: list[Candidate],
    names: tuple[str, ...],
    settings: SearchSettings,
) -> tuple[str, SearchResult] | None:
    """Return the most probable candidate and its result; None if no candidate is significant.

    `names` were selected before. The scatter of the result includes the spread of the estimates with the
    other significant candidates, and without any.
    """
    significant: list[tuple[str, SearchResult]] = []
    for candidate in candidates:
        if significant and candidate.share > SENSOR_SELECTION.rival_share * candidates[0].share:
            continue
        if not candidate.promising and not any(sensor_error(name) for name, _ in significant):
            continue
        child = settings.child("nuisance selection", candidate.name)
        # Only a sensor error has to explain most of the residual beyond the expected size.
        is_hopeless = hopelessness_relative_to(result) if sensor_error(candidate.name) else never
        point = candidate.point[np.newaxis]
        tried = correct_bias(
            candidate.objective, point, child.max_corrections, child.seed, is_hopeless=is_hopeless
        )
        if candidate.name == SUPPLY:
            tried = with_supply(tried, names, child)
        if _is_significant(tried, result, candidate.name, child.seed) and _is_confirmed(
            tried, result, candidate.name, child
        ):
            significant.append((candidate.name, tried))
    if not significant:
        return None
    power_without = residual_power(result, result, settings.seed) if len(significant) > 1 else 1.0
    levels = []
    for name, tried in significant:
        share = (
            share_of_residual(tried, result)
            if len(significant) == 1
            else residual_power(tried, result, settings.seed) / power_without
        )
        levels.append(_improbability(tried, result, name, share))
    best_index = int(np.argmin(levels))
    name, best = significant[best_index]
    rivals = [result, *(rival for i, (_, rival) in enumerate(significant) if i != best_index)]
    other_levels = np.array([0.0, *np.delete(levels, best_index)])
    return name, with_rivals(best, rivals, other_levels - levels[best_index])


def _improbability(tried: SearchResult, before: SearchResult, name: str, share: float) -> float:
    """Return -2 ln of the probability of `tried`, with the nuisance `name`, relative to `before`, without it.

    `share` is the ratio of their mean squared residuals.

    The likelihood counts `CORRELATED_ROWS` rows as one independent row. The prior is that of the description:
    normal for parameters of the actuator, Cauchy for sensor errors, which may have any size. With equal
    residuals, a deviation of 5 % of the inertia, described to 5 %, is therefore more probable than 5 % of the
    scale of the voltage, described to 1 %.
    """
    rows = before.objective.compared_rows / CORRELATED_ROWS
    squared = _deviation(tried, name) ** 2
    prior = 2 * np.log1p(squared) if sensor_error(name) else squared
    return float(rows * np.log(share) + prior)


def _is_confirmed(tried: SearchResult, before: SearchResult, name: str, settings: SearchSettings) -> bool:
    """Return whether a significant estimate of `name` in `tried` is also significant by two further tests.

    First, with the standard error by the reference model's derivatives: in slow motions those of the fitted
    model are too large by factors. Second, compared with the search without the nuisance from the end point
    of `tried`: the nuisance may only have led the search out of a local minimum.
    """
    if name in tried.objective.space.nuisances.located:
        return True
    response = reference_response(tried, stream(settings.seed, "response of the selected nuisance"))
    if response is not None and not _is_significant(tried, before, name, settings.seed, response):
        return False
    repeated = without_law(tried, before, settings)
    is_repetition_better = share_of_residual(repeated, before) < 1 / SELECTION.equal_share
    return not is_repetition_better or _is_significant(tried, repeated, name, settings.seed, response)


def _is_significant(
    tried: SearchResult, before: SearchResult, name: str, seed: int, response: Array | None = None
) -> bool:
    """Return whether the estimate of `name` in `tried` is significant; `response` as in `_score`."""
    if abs(_deviation(tried, name)) <= SELECTION.least_deviation:
        return False
    if name in tried.objective.space.nuisances.located:
        return is_off(tried) and ripple_share(tried, before, seed) < SELECTION.likely_share
    share, score = share_of_residual(tried, before), _score(tried, name, seed, response)
    equal = 1.0 if sensor_error(name) else SELECTION.equal_share
    significant = (score >= SELECTION.certain_score and share < equal) or (
        (score >= SELECTION.likely_score or name in PROFILED) and share < SELECTION.likely_share
    )
    return significant and (sensor_error(name) is None or _exceeds_chance(tried, name, share))


def _deviation(tried: SearchResult, name: str) -> float:
    """Return the deviation of `name` from nominal, in standard deviations of its described prior."""
    objective = tried.objective
    value = float(objective.space.nuisance_values(tried.point[np.newaxis])[name][0])
    return value / usual_deviation(objective.problem.actuator, name)


def _exceeds_chance(tried: SearchResult, name: str, share: float) -> bool:
    """Return whether an estimated sensor error exceeds the effects of chance and of the sampling interval."""
    objective = tried.objective
    if not tried.residual_is_expected and share >= SENSOR_SELECTION.excess_share:
        return False
    correlated_rows = longest_correlation(tried.residual_by_channel.values())
    if share >= 1 - SENSOR_SELECTION.chance * correlated_rows / objective.compared_rows:
        return False
    value = float(objective.space.nuisance_values(tried.point[np.newaxis])[name][0])
    smallest_delay = SENSOR_SELECTION.least_rows * objective.problem.inputs.interval
    return error_kind(name) != "delay" or abs(value) > smallest_delay


def _score(result: SearchResult, name: str, seed: int, response: Array | None = None) -> float:
    """Return the deviation of `name` from nominal, in standard errors.

    With the `response` (d, channel rows) of the reference model, the error includes the step that remains by
    it, and, in slow motions, the effect of switching on the estimate.
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
