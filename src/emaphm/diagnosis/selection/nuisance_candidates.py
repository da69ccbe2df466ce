"""Nuisances worth trying: a score test for each, and descents from where it leads."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.selection.profile import PROFILE, PROFILED, profile
from emaphm.diagnosis.selection.sensor_error_scores import jacobians_with_errors, regressed_error
from emaphm.estimation.global_search.multistart import local_search, with_descents
from emaphm.estimation.nuisances import PRIORS_PER_UNIT, NuisanceSet, with_wider_priors
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.parameter_space import ParameterSpace
from emaphm.estimation.search_result import SearchResult, default_scatter
from emaphm.estimation.sensors.sensor_model import sensor_error, sensor_of
from emaphm.estimation.uncertainty.local_covariance import (
    local_covariance,
)
from emaphm.random_streams import stream


@dataclass(frozen=True)
class NuisanceSelectionSettings:
    """When a nuisance is tried, and when it is kept; `make study` (limits, inertia and supply) measures them.

    Tried: a score above `tried_score` standard errors, and descents that leave less than `tried_share` of the
    mean squared residual. Derivatives at a wrong estimate make scores unreliable: 5 % of inertia had 1.6 to 7
    where line voltage was recorded, the actuator as described up to 4. Descents separate them: with 5 % of
    inertia they left 0.998 at most, 0.98 mostly; as described 0.996 and more, but for 1 recording in 100.

    Kept: an estimate `certain_score` standard errors off nominal with a smaller residual, or `likely_score`
    with less than `likely_share` of it, for which a profiled one needs no score: the kinks that a search
    ends at make its scatter large. 5 % of inertia, once estimated, left 0.65 to 0.95; the actuator as
    described no less than chance, 0.96. Chance is switching, up to `equal_share`: of what belongs to the
    actuator, a certain score decides within it. It must also be off by `least_deviation`, a share of its
    prior's standard deviation: less is expected of every actuator.

    The data must determine the nuisance to `informative`, a share of its prior's standard deviation.
    The prior of what is tried is `widening` times as wide: it would otherwise shrink a large deviation.
    """

    tried_score: float = 1.0
    tried_share: float = 0.995
    certain_score: float = 3.0
    likely_score: float = 1.5
    likely_share: float = 0.95
    equal_share: float = 1.03
    least_deviation: float = 0.5
    informative: float = 1.0
    widening: float = 4.0
    descents: int = 2


SELECTION = NuisanceSelectionSettings()


@dataclass(frozen=True)
class SensorSelectionSettings:
    """What is different for errors of sensors: faults of a sensor are of any size, and there are many kinds.

    Tried: the `most_tried` of the largest scores, `tried_score` at least. Even large faults score no more
    than 2 to 5 where the search has bent the actuator's faults to them: 1 to 5 rows of delay 2.2 to 3.7, a
    voltage × 0.5 6, a current × 1.2 5 (3 random fault vectors each). Descents separate them.

    Priors are `widening` times as wide, those of delays `delay_widening`: flat for whatever can be recorded,
    up to 11 times the scale, 20 rows of a delay at 5 kHz. A search begins within `search_widening` times the
    prior: 15 % of scale, 3 ms of delay, and twice that.

    The data must determine one to `informative` prior standard deviations at the estimate without it, where a
    wrong estimate makes standard errors large too.

    Where a factor leaves less than `gross_share` of a channel's rms residual, descents begin at that factor:
    a reversed sensor is beyond what the derivatives show.

    Of candidates whose descents leave up to `rival_share` times the least residual, that with the least one
    after its own correction is kept: errors of one channel look like those of another. One that leaves the
    recording unexplained has to leave less than `unexplained_share` of the residual.

    A parameter that is not needed removes χ² / rows of the mean squared residual, with one degree of freedom.
    Of the seventeen errors, none exceeds `chance` in 99 of 100 recordings. A delay is also more than
    `least_rows` of a row: of slow rows, how a signal runs between them is known no better.
    """

    tried_score: float = 1.8
    most_tried: int = 3
    widening: float = 250.0
    delay_widening: float = 5.0
    informative: float = 10.0
    gross_share: float = 0.6
    search_widening: float = 15.0
    most_corrected: int = 3
    rival_share: float = 1.5
    unexplained_share: float = 0.5
    chance: float = 12.0
    least_rows: float = 0.1


SENSOR_SELECTION = SensorSelectionSettings()


ZEROS_OF_START = {"position_offset": "position_rad", "speed_offset": "speed_rad_s"}

"""Zeros of the sensors that say where a manoeuvre starts, by nuisance."""


def widening(name: str) -> float:
    """Return how many times as wide as the description's the prior of a tried nuisance is."""
    error = sensor_error(name)
    if error is None:
        return SELECTION.widening
    return SENSOR_SELECTION.delay_widening if error[1] == "delay" else SENSOR_SELECTION.widening


def _informative(name: str) -> float:
    """Return the standard error that the data must give at most, in standard deviations of the prior."""
    return SENSOR_SELECTION.informative if sensor_error(name) else SELECTION.informative


@dataclass(frozen=True, eq=False)
class Candidate:
    """A nuisance, the objective and point (d,) that descents with it lead to, and the share of residual.

    The share is that of the descents, or the reference model's where the nuisance is profiled. One that is
    not `promising` is tried only where its rivals would be selected.
    """

    name: str
    objective: MapObjective
    point: Array
    share: float
    promising: bool = True


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
    candidates = [
        _refit_with(name, *starts[name][1:], result, seed)
        for name in _worth_trying({name: score for name, (score, _, _) in starts.items()})
    ]
    candidates = [candidate for candidate in candidates if candidate.share < SELECTION.tried_share]
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
    """Return the names whose scores are large enough, of sensors' errors the most promising alone."""
    sensors = sorted((name for name in scores if sensor_error(name)), key=lambda name: -scores[name])
    likely = [name for name in sensors if scores[name] > SENSOR_SELECTION.tried_score]
    chosen = likely[: SENSOR_SELECTION.most_tried]
    return [
        name
        for name, score in scores.items()
        if name in chosen or (name not in sensors and score > SELECTION.tried_score)
    ]


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
    correction = np.zeros_like(objective.target)
    correction[:rows] = result.outputs_correction[:rows]
    rng = stream(seed, "descents of the score test", name)
    start = objective.space.project(start)
    point = local_search(objective, start, correction, rng, with_descents(SELECTION.descents)).best
    residual = objective.residual(point, correction)[:rows]
    share = float(np.mean(residual**2) / np.mean(result.residual[:rows] ** 2))
    return Candidate(name, objective, point, share)


def with_nuisances(
    result: SearchResult, names: tuple[str, ...], more: tuple[str, ...], factor: float | None = None
) -> tuple[MapObjective, Array]:
    """Return the objective with `more` nuisances, and the point (d,) of `result` in its space.

    They have wide priors, as have `names`, which were selected before; `factor` times as wide where given.
    """
    objective = result.objective
    actuator, measured = objective.problem.actuator, tuple(objective.problem.measured)
    chosen = (*objective.space.nuisances.chosen, *more)
    factors = {name: widening(name) for name in (*names, *more)}
    wider = with_wider_priors(actuator, factors | (dict.fromkeys(more, factor) if factor else {}))
    space = ParameterSpace.of(
        actuator, NuisanceSet.of(wider, chosen, measured, objective.space.nuisances.unit)
    )
    values = dict(zip(objective.space.coordinates, result.point, strict=True))
    problem = objective.problem
    for name, channel in ZEROS_OF_START.items():
        # What is recorded does not say where the manoeuvre starts if its zero is not known.
        if more == (name,) or name in names:
            problem = problem.starting_without(channel)
    return replace(objective, problem=problem, space=space), np.array(
        [values.get(name, 0.0) for name in space.coordinates]
    )
