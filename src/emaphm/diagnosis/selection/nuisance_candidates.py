"""Nuisances worth trying: a score test for each, and descents from where it leads."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.selection.extension import Candidate, with_nuisances
from emaphm.diagnosis.selection.profile import PROFILE, PROFILED, profile
from emaphm.diagnosis.selection.sensor_error_scores import jacobians_with_errors, regressed_error
from emaphm.diagnosis.selection.settings import SELECTION, SENSOR_SELECTION, widening
from emaphm.diagnosis.selection.supply_profile import SUPPLY
from emaphm.diagnosis.selection.supply_scan import is_scanned, supply_candidate
from emaphm.estimation.global_search.multistart import local_search, with_descents
from emaphm.estimation.nuisances import PRIORS_PER_UNIT
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult, default_scatter
from emaphm.estimation.sensors.sensor_model import sensor_error, sensor_of
from emaphm.estimation.uncertainty.local_covariance import (
    local_covariance,
)
from emaphm.random_streams import stream

MADE_UP_FOR = ("voltage_scale",)
"""Errors of sensors that faults make up for nearly, so that they have small scores of their own: a voltage of
another scale reads as shorts of all phases, and what these leave scores as an error of another kind."""


def _informative(name: str) -> float:
    """Return the standard error that the data must give at most, in standard deviations of the prior."""
    return SENSOR_SELECTION.informative if sensor_error(name) else SELECTION.informative


def worthwhile_candidates(
    result: SearchResult, names: tuple[str, ...], seed: int
) -> tuple[SearchResult, list[Candidate]]:
    """Return the nuisances worth trying, of those neither estimated nor known; the most promising first.

    `names` were selected before, and are estimated in `result`, which is returned with its Jacobians.
    """
    objective = result.objective
    problem = objective.problem
    others = objective.space.nuisances.others(problem.actuator, tuple(problem.measured))
    if not others:
        return result, []
    wide, start = with_nuisances(result, names, others)
    jacobians = jacobians_with_errors(wide, start, stream(seed, "Jacobians of the score test", *names))
    residual = result.residual[: objective.channel_rows]
    own = [i for i, name in enumerate(wide.space.coordinates) if name in objective.space.coordinates]
    starts: dict[str, tuple[float, MapObjective, Array]] = {}
    profiled: list[Candidate] = []
    for name in others:
        if name == SUPPLY and is_scanned(problem.actuator):
            scanned = supply_candidate(result, names, seed)
            profiled += [] if scanned is None else [scanned]
            continue
        extended, point = with_nuisances(result, names, (name,))
        i, column = extended.space.coordinates.index(name), wide.space.coordinates.index(name)
        if sensor_error(name):
            others_step, size, error = regressed_error(
                jacobians[:, own], jacobians[0, column], residual, len(objective.problem.channels)
            )
            step = np.insert(others_step, i, size)
        else:
            # Jacobians were taken for all at once; each is judged as if it alone were estimated too.
            kept = [
                k for k, other in enumerate(wide.space.coordinates) if other in extended.space.coordinates
            ]
            if name in PROFILED:
                profiled.append(_profiled(name, result, extended, point, jacobians[:, kept], seed))
                if profiled[-1].promising:
                    continue
            local = local_covariance(extended, point, residual, jacobians[:, kept])
            step = local.step
            error = float((local.covariance + default_scatter(point.size))[i, i] ** 0.5)
        if error < _informative(name) / PRIORS_PER_UNIT / widening(name):
            starts[name] = float(abs(step[i])) / error, extended, point + step
    starts |= _gross_starts(result, names, others)
    scores = {name: score for name, (score, _, _) in starts.items()}
    candidates = [_refit_with(name, *starts[name][1:], result, seed) for name in _worth_trying(scores)]
    candidates = [candidate for candidate in candidates if _leaves_less(candidate, scores)]
    named = {candidate.name for candidate in candidates}
    candidates += [candidate for candidate in profiled if candidate.name not in named]
    known = replace(result, jacobians=jacobians[:, own])
    return known, sorted(candidates, key=lambda candidate: (not candidate.promising, candidate.share))


def _profiled(
    name: str, result: SearchResult, objective: MapObjective, start: Array, jacobians: Array, seed: int
) -> Candidate:
    """Return the nuisance off nominal, on the side that the reference model prefers."""
    unit = 1 / PRIORS_PER_UNIT / widening(name)
    points, shares = profile(result, objective, start, jacobians, name, PROFILE.away * unit, seed)
    best = int(np.argmin(shares))
    off = abs(points[best][objective.space.coordinates.index(name)])
    promising = bool(shares[best] < PROFILE.tried_share and off > SELECTION.least_deviation * unit)
    return Candidate(name, objective, points[best], float(shares[best]), promising)


def _worth_trying(scores: Mapping[str, float]) -> list[str]:
    """Return the names whose scores are large enough, of sensors' errors the most promising alone.

    And those that faults make up for, where any error of a sensor has a large score.
    """
    sensors = sorted((name for name in scores if sensor_error(name)), key=lambda name: -scores[name])
    likely = [name for name in sensors if scores[name] > SENSOR_SELECTION.tried_score]
    chosen = likely[: SENSOR_SELECTION.most_tried]
    if _any_sure(scores):
        chosen += [name for name in MADE_UP_FOR if name in scores and name not in chosen]
    return [
        name
        for name, score in scores.items()
        if name in chosen or (name not in sensors and score > SELECTION.tried_score)
    ]


def _leaves_less(candidate: Candidate, scores: Mapping[str, float]) -> bool:
    """Return whether a candidate leaves enough less of the residual for a correction of its own."""
    if candidate.name in MADE_UP_FOR and _any_sure(scores):
        return candidate.share < SENSOR_SELECTION.made_up_share
    if sensor_error(candidate.name) and scores[candidate.name] > SENSOR_SELECTION.sure_score:
        return candidate.share < 1.0
    return candidate.share < SELECTION.tried_share


def _any_sure(scores: Mapping[str, float]) -> bool:
    """Return whether any error of a sensor has a large score."""
    return any(score > SENSOR_SELECTION.sure_score for name, score in scores.items() if sensor_error(name))


def _gross_starts(
    result: SearchResult, names: tuple[str, ...], others: tuple[str, ...]
) -> dict[str, tuple[float, MapObjective, Array]]:
    """Return scores, objectives and points to begin with of scales that are far off, by the nuisance."""
    problem = result.objective.problem
    measured = result.objective.target[: result.objective.channel_rows].reshape(len(problem.channels), -1)
    residuals = result.residual[: result.objective.channel_rows].reshape(measured.shape)
    starts = {}
    for channel, target, residual in zip(problem.channels, measured, residuals, strict=True):
        name = f"{sensor_of(channel)}_scale"
        model = target - residual
        power = float(model @ model)
        if name not in others or power == 0:
            continue
        factor = float(model @ target) / power
        variance = float(np.mean((target - factor * model) ** 2))
        if variance < SENSOR_SELECTION.gross_share**2 * float(np.mean(residual**2)):
            extended, point = with_nuisances(result, names, (name,))
            deviation = float(extended.space.nuisances.prior_deviations[-1])
            i = extended.space.coordinates.index(name)
            point[i] = (factor - 1) / float(extended.space.nuisances.meaning[-1, -1]) if deviation else 0.0
            starts[name] = np.inf, extended, point
    return starts


def _refit_with(
    name: str, objective: MapObjective, start: Array, result: SearchResult, seed: int
) -> Candidate:
    """Return where descents lead from `start` (d,) under the correction of `result`."""
    rows = result.objective.channel_rows
    correction = objective.of_channels(result.outputs_correction)
    rng = stream(seed, "descents of the score test", name)
    start = objective.space.project(start)
    point = local_search(objective, start, correction, rng, with_descents(SELECTION.descents)).best
    residual = objective.residual(point, correction)[:rows]
    share = float(np.mean(residual**2) / np.mean(result.residual[:rows] ** 2))
    return Candidate(name, objective, point, share)
