"""Nuisances worth trying: a score test for each, and descents from where it leads."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.selection.extension import Candidate, with_nuisances
from emaphm.diagnosis.selection.first_look import FirstLook, first_look
from emaphm.diagnosis.selection.profile import INERTIA, PROFILE, PROFILED, profile, profile_points
from emaphm.diagnosis.selection.sensor_error_scores import jacobians_with_errors
from emaphm.diagnosis.selection.settings import SELECTION, SENSOR_SELECTION, widening
from emaphm.diagnosis.selection.supply.supply_profile import SUPPLY
from emaphm.diagnosis.selection.supply.supply_scan import is_inductance_known, is_scanned, supply_candidate
from emaphm.estimation.global_search.multistart import local_search, with_descents
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult, default_scatter
from emaphm.estimation.sensors.sensor_model import sensor_error, sensor_of
from emaphm.estimation.space.nuisances import PRIORS_PER_UNIT
from emaphm.estimation.uncertainty.local_covariance import (
    local_covariance,
)
from emaphm.estimation.uncertainty.partial_regression import regressed
from emaphm.random_streams import stream

MADE_UP_FOR = ("voltage_scale",)
"""Errors of sensors that faults make up for nearly, so that they have small scores of their own: a voltage of
another scale reads as shorts of all phases, and what these leave scores as an error of another kind."""


def _informative(name: str) -> float:
    """Return the standard error that the data must give at most, in standard deviations of the prior."""
    return SENSOR_SELECTION.informative if sensor_error(name) else SELECTION.informative


@dataclass(frozen=True, eq=False)
class Worthwhile:
    """The `candidates` worth trying at `result`, the most promising first, and what a first look showed."""

    result: SearchResult
    candidates: list[Candidate]
    look: FirstLook


def worthwhile_candidates(result: SearchResult, names: tuple[str, ...], seed: int) -> Worthwhile:
    """Return the nuisances worth trying, of those neither estimated nor known.

    `names` were selected before, and are estimated in `result`, which is returned with its Jacobians.
    """
    objective = result.objective
    problem = objective.problem
    others = objective.space.nuisances.others(problem.actuator, tuple(problem.measured))
    if not others:
        return Worthwhile(result, [], FirstLook())
    scanned = (SUPPLY,) if SUPPLY in others and is_scanned(problem.actuator) else ()
    scored = tuple(name for name in others if name not in scanned)
    wide, start = with_nuisances(result, names, others)
    jacobians = jacobians_with_errors(wide, start, stream(seed, "Jacobians of the score test", *names))
    derivatives = _Derivatives(result, wide, jacobians)
    profiles = {name: _profile_of(name, names, derivatives) for name in PROFILED if name in scored}
    look = first_look(result, names, profiles.get(INERTIA), seed)
    profiled = [_profiled(name, result, *one, look, seed) for name, one in profiles.items()]
    promising = [candidate.name for candidate in profiled if candidate.promising]
    if scanned and look.shows_supply and is_inductance_known(objective):
        candidate = supply_candidate(result, names, seed)
        profiled += [] if candidate is None else [candidate]
    starts: dict[str, tuple[float, MapObjective, Array]] = {}
    for name in scored:
        if name in promising:
            continue
        extended, point = with_nuisances(result, names, (name,))
        step, error = derivatives.step_to(name, extended, point)
        size = float(abs(step[extended.space.coordinates.index(name)]))
        if error < _informative(name) * _unit(name):
            starts[name] = size / error, extended, point + step
    starts |= gross_scale_starts(result, names, others)
    scores = {name: score for name, (score, _, _) in starts.items()}
    candidates = [_refit_with(name, *starts[name][1:], result, seed) for name in _worth_trying(scores)]
    candidates = [candidate for candidate in candidates if _leaves_less(candidate, scores)]
    named = {candidate.name for candidate in candidates}
    candidates += [candidate for candidate in profiled if candidate.name not in named]
    candidates.sort(key=lambda candidate: (not candidate.promising, candidate.share))
    return Worthwhile(replace(result, jacobians=derivatives.own), candidates, look)


@dataclass(frozen=True, eq=False)
class _Derivatives:
    """Jacobians (n, d, channel rows) of all that is `wide`, taken at once, about the estimate of `result`."""

    result: SearchResult
    wide: MapObjective
    jacobians: Array

    @cached_property
    def own(self) -> Array:
        """Those by what is estimated already."""
        return self.of(self.result.objective)

    @cached_property
    def mean(self) -> Array:
        """The mean of these, (d, channel rows)."""
        return np.asarray(self.own.mean(axis=0))

    def of(self, other: MapObjective) -> Array:
        """Return those by the coordinates of another objective."""
        coordinates = other.space.coordinates
        return self.jacobians[
            :, [i for i, name in enumerate(self.wide.space.coordinates) if name in coordinates]
        ]

    def step_to(self, name: str, extended: MapObjective, point: Array) -> tuple[Array, float]:
        """Return the step (d,) from `point` (d,) of an objective that has `name` too, and its error there.

        Each is judged as if it alone were estimated too.
        """
        objective, i = self.result.objective, extended.space.coordinates.index(name)
        residual = self.result.residual[: objective.channel_rows]
        if sensor_error(name):
            derivative = self.jacobians[:1, self.wide.space.coordinates.index(name)]
            step, sizes, covariance = regressed(self.mean, derivative, residual, objective.problem)
            return np.insert(step, i, sizes[0]), float(covariance[0, 0] ** 0.5)
        local = local_covariance(extended, point, residual, self.of(extended))
        error = float((local.covariance + default_scatter(point.size))[i, i] ** 0.5)
        return local.step, error


def _profile_of(name: str, names: tuple[str, ...], derivatives: _Derivatives) -> tuple[MapObjective, Array]:
    """Return the objective with a nuisance that the reference model is asked for, and points (2, d) of it."""
    result = derivatives.result
    extended, point = with_nuisances(result, names, (name,))
    step = PROFILE.away * _unit(name)
    return extended, profile_points(result, extended, point, derivatives.of(extended), name, step)


def _unit(name: str) -> float:
    """Return the coordinate of a tried nuisance that is a standard deviation of the description off."""
    return 1 / PRIORS_PER_UNIT / widening(name)


def _profiled(
    name: str, result: SearchResult, objective: MapObjective, points: Array, look: FirstLook, seed: int
) -> Candidate:
    """Return the nuisance off nominal, at the one of `points` (n, d) that the reference model prefers."""
    shares = profile(result, objective, points, name, seed) if look.shows_inertia else look.inertia
    best = int(np.argmin(shares))
    off = abs(points[best][objective.space.coordinates.index(name)])
    promising = bool(shares[best] < PROFILE.tried_share and off > SELECTION.least_deviation * _unit(name))
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


def gross_scale_starts(
    result: SearchResult, names: tuple[str, ...], others: tuple[str, ...]
) -> dict[str, tuple[float, MapObjective, Array]]:
    """Return scores, objectives and points (d,) to begin with of scales that are far off, by the nuisance."""
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
            nuisances = extended.space.nuisances
            i = nuisances.quantities.index(name)
            point[extended.space.coordinates.index(name)] = (factor - 1) / float(nuisances.meaning[i, i])
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
    share = result.objective.mean_square(residual) / result.objective.mean_square(result.residual[:rows])
    return Candidate(name, objective, point, share)
