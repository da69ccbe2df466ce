"""Candidate nuisances: a score test of each, and descents from its estimate."""

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
from emaphm.estimation.global_search.multistart import local_search
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult, default_scatter
from emaphm.estimation.sensors.sensor_model import sensor_error, sensor_of
from emaphm.estimation.space.nuisances import PRIORS_PER_UNIT
from emaphm.estimation.uncertainty.local_covariance import (
    local_covariance,
)
from emaphm.estimation.uncertainty.partial_regression import regressed
from emaphm.random_streams import stream

COMPENSATED = ("voltage_scale",)
"""Sensor errors for which faults nearly compensate, so that their scores are small: another scale of the
voltage appears as shorts of all phases, and the remaining residual gives a score of another sensor error."""


def _largest_error(name: str) -> float:
    """Return the largest accepted standard error due to the data, in standard deviations of the prior."""
    return SENSOR_SELECTION.informative if sensor_error(name) else SELECTION.informative


@dataclass(frozen=True, eq=False)
class Worthwhile:
    """The `candidates` to try at `result`, the most promising first, and the first look."""

    result: SearchResult
    candidates: list[Candidate]
    look: FirstLook


def worthwhile_candidates(result: SearchResult, names: tuple[str, ...], seed: int) -> Worthwhile:
    """Return the candidates among the nuisances that are neither estimated nor known.

    `names` were selected before, and are estimated in `result`, which is returned with its Jacobians.
    """
    objective = result.objective
    problem = objective.problem
    possible = objective.space.nuisances.others(problem.actuator, tuple(problem.measured))
    if not possible:
        return Worthwhile(result, [], FirstLook())
    scanned = (SUPPLY,) if SUPPLY in possible and is_scanned(problem.actuator) else ()
    scored = tuple(name for name in possible if name not in scanned)
    wide, start = with_nuisances(result, names, possible)
    known = {} if result.jacobians is None else _by_coordinate(result.jacobians, objective)
    jacobians = jacobians_with_errors(wide, start, stream(seed, "Jacobians of the score test", *names), known)
    derivatives = _Derivatives(result, wide, jacobians)
    profiles = {name: _profile_points(name, names, derivatives) for name in PROFILED if name in scored}
    look = first_look(result, names, profiles.get(INERTIA), seed)
    profiled = [_profiled_candidate(name, result, *points, look, seed) for name, points in profiles.items()]
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
        if error < _largest_error(name) * _coordinate_of_deviation(name):
            starts[name] = size / error, extended, point + step
    starts |= gross_scale_starts(result, names, possible)
    scores = {name: score for name, (score, _, _) in starts.items()}
    candidates = [_refit_with(name, *starts[name][1:], result, seed) for name in _names_to_try(scores)]
    candidates = [candidate for candidate in candidates if _is_residual_small(candidate, scores)]
    refitted = {candidate.name for candidate in candidates}
    candidates += [candidate for candidate in profiled if candidate.name not in refitted]
    candidates.sort(key=lambda candidate: (not candidate.promising, candidate.share))
    return Worthwhile(replace(result, jacobians=derivatives.own), candidates, look)


def _by_coordinate(jacobians: Array, objective: MapObjective) -> dict[str, Array]:
    """Return the derivatives (n, channel rows) of `jacobians` (n, d, channel rows) by coordinate."""
    return dict(zip(objective.space.coordinates, jacobians.swapaxes(0, 1), strict=True))


@dataclass(frozen=True, eq=False)
class _Derivatives:
    """Jacobians (n, d, channel rows) of the objective `wide`, which has all nuisances, about `result`."""

    result: SearchResult
    wide: MapObjective
    jacobians: Array

    @cached_property
    def own(self) -> Array:
        """The Jacobians with respect to the coordinates of `result`."""
        return self.of(self.result.objective)

    @cached_property
    def mean(self) -> Array:
        """The mean of `own`, (d, channel rows)."""
        return np.asarray(self.own.mean(axis=0))

    def of(self, other: MapObjective) -> Array:
        """Return the Jacobians with respect to the coordinates of another objective."""
        coordinates = other.space.coordinates
        return self.jacobians[
            :, [i for i, name in enumerate(self.wide.space.coordinates) if name in coordinates]
        ]

    def step_to(self, name: str, extended: MapObjective, point: Array) -> tuple[Array, float]:
        """Return the Gauss-Newton step (d,) from `point` (d,), and the standard error of the nuisance `name`.

        `extended` is the objective with this nuisance alone in addition.
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


def _profile_points(
    name: str, names: tuple[str, ...], derivatives: _Derivatives
) -> tuple[MapObjective, Array]:
    """Return the objective with a profiled nuisance, and points (2, d) of it for the reference model."""
    result = derivatives.result
    extended, point = with_nuisances(result, names, (name,))
    step = PROFILE.away * _coordinate_of_deviation(name)
    return extended, profile_points(result, extended, point, derivatives.of(extended), name, step)


def _coordinate_of_deviation(name: str) -> float:
    """Return the coordinate of a nuisance at one standard deviation of its described prior."""
    return 1 / PRIORS_PER_UNIT / widening(name)


def _profiled_candidate(
    name: str, result: SearchResult, objective: MapObjective, points: Array, look: FirstLook, seed: int
) -> Candidate:
    """Return the candidate at that point of `points` (n, d) which the reference model fits best."""
    shares = profile(result, objective, points, name, seed) if look.shows_inertia else look.inertia
    best = int(np.argmin(shares))
    deviation = abs(points[best][objective.space.coordinates.index(name)])
    promising = bool(
        shares[best] < PROFILE.tried_share
        and deviation > SELECTION.least_deviation * _coordinate_of_deviation(name)
    )
    return Candidate(name, objective, points[best], float(shares[best]), promising)


def _names_to_try(scores: Mapping[str, float]) -> list[str]:
    """Return the names whose scores are large enough; of sensor errors only the largest ones.

    If any sensor error has a large score, the errors `COMPENSATED` by faults are added.
    """
    sensors = sorted((name for name in scores if sensor_error(name)), key=lambda name: -scores[name])
    with_large_score = [name for name in sensors if scores[name] > SENSOR_SELECTION.tried_score]
    chosen = with_large_score[: SENSOR_SELECTION.most_tried]
    if _has_large_sensor_score(scores):
        chosen += [name for name in COMPENSATED if name in scores and name not in chosen]
    return [
        name
        for name, score in scores.items()
        if name in chosen or (name not in sensors and score > SELECTION.tried_score)
    ]


def _is_residual_small(candidate: Candidate, scores: Mapping[str, float]) -> bool:
    """Return whether the residual with a candidate is small enough to correct its bias."""
    if candidate.name in COMPENSATED and _has_large_sensor_score(scores):
        return candidate.share < SENSOR_SELECTION.made_up_share
    if sensor_error(candidate.name) and scores[candidate.name] > SENSOR_SELECTION.sure_score:
        return candidate.share < 1.0
    return candidate.share < SELECTION.tried_share


def _has_large_sensor_score(scores: Mapping[str, float]) -> bool:
    """Return whether any sensor error has a large score."""
    return any(score > SENSOR_SELECTION.sure_score for name, score in scores.items() if sensor_error(name))


def gross_scale_starts(
    result: SearchResult, names: tuple[str, ...], others: tuple[str, ...]
) -> dict[str, tuple[float, MapObjective, Array]]:
    """Return scores, objectives and starting points of scales with a large error, by nuisance."""
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
    """Return the candidate at the end of descents from `start` (d,) with the correction of `result`."""
    rows = result.objective.channel_rows
    correction = objective.of_channels(result.outputs_correction)
    rng = stream(seed, "descents of the score test", name)
    start = objective.space.project(start)
    point = local_search(objective, start, correction, rng, SELECTION.descents).best
    residual = objective.residual(point, correction)[:rows]
    share = result.objective.mean_square(residual) / result.objective.mean_square(result.residual[:rows])
    return Candidate(name, objective, point, share)
