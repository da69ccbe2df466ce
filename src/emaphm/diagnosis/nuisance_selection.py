"""Parameters that deviate from the description although nobody asked to estimate them: a score test.

A wrong inertia reads as a fault wherever it is taken as known, and leaves hardly more residual. But where
the recording has information on it, a Gauss-Newton step leads away from its nominal value (Rao 1948; Engle
1984), and descents from there leave a slightly smaller residual. The nuisance is then estimated with the
faults. It is kept if it is still significant, deviates by more than every actuator does, and the residual is
smaller.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.multistart import local_search, multistart, with_descents
from emaphm.estimation.nuisances import PRIORS_PER_UNIT, NuisanceSet, with_wider_priors
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.parameter_space import Box, ParameterSpace
from emaphm.estimation.search_result import EXPLAINED_RESIDUAL, SearchResult, default_scatter
from emaphm.estimation.sensor_model import COMMON_DELAY, sensor_error, sensor_of
from emaphm.estimation.uncertainty.local_covariance import (
    JACOBIAN_STEP,
    REPLICATES,
    jacobians_at,
    local_covariance,
)
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance
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


SENSOR_SELECTION = SensorSelectionSettings()


ZEROS_OF_START = {"position_offset": "position_rad", "speed_offset": "speed_rad_s"}
"""Zeros of the sensors that say where a manoeuvre starts, by nuisance."""


def widening(name: str) -> float:
    """Return how many times as wide as the description's the prior of a tried nuisance is."""
    error = sensor_error(name)
    if error is None:
        return SELECTION.widening
    return SENSOR_SELECTION.delay_widening if error[1] == "delay" else SENSOR_SELECTION.widening


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
        best = _best(result, candidates, max_corrections, seed)
        if not _explained(result if best is None else best[1]):
            best = _from_afar(result, names, max_corrections, seed) or best
        if best is None:
            return result, names
        result, names = best[1], (*names, best[0])


def _explained(result: SearchResult) -> bool:
    return result.normalised_residual <= EXPLAINED_RESIDUAL


def _from_afar(
    result: SearchResult, names: tuple[str, ...], max_corrections: int, seed: int
) -> tuple[str, SearchResult] | None:
    """Return the error of sensors, and the result with it, that explains what is not explained without.

    A delay of several rows reads as another gain, a scale as shorts, a zero as a load: they lead the search so
    far astray that no descent from there finds back. Each is searched for anew, and the `most_corrected` that
    explain most are corrected.
    """
    problem = result.objective.problem
    others = result.objective.space.nuisances.others(problem.actuator, tuple(problem.measured))
    searched: list[tuple[float, str, MapObjective, Array]] = []
    for name in others:
        kind = (sensor_error(name) or ("", ""))[1]
        if name != COMMON_DELAY and kind not in ("scale", "offset"):
            continue
        narrow, _ = _with_nuisances(result, names, (name,), SENSOR_SELECTION.search_widening)
        wide, _ = _with_nuisances(result, names, (name,))
        found = multistart(narrow, child_seed(seed, "search with a nuisance", name))
        points = found.points.copy()
        points[:, wide.space.coordinates.index(name)] *= SENSOR_SELECTION.search_widening / widening(name)
        searched.append((float(found.costs.min()), name, wide, points))
    outcomes: list[tuple[str, SearchResult]] = []
    for _, name, wide, points in sorted(searched, key=lambda one: one[0])[: SENSOR_SELECTION.most_corrected]:
        child = child_seed(seed, "nuisance selection from afar", name)
        tried = correct_bias(wide, points, max_corrections, child)
        if _explained(tried) and _significant(tried, result, name, child):
            outcomes.append((name, tried))
    return min(outcomes, key=lambda one: _share_of_residual(one[1], result)) if outcomes else None


def _best(
    result: SearchResult, candidates: list[_Candidate], max_corrections: int, seed: int
) -> tuple[str, SearchResult] | None:
    """Return the candidate that explains most and its result, None where none is significant."""
    kept: list[tuple[str, SearchResult]] = []
    for candidate in candidates:
        if kept and candidate.share > SENSOR_SELECTION.rival_share * candidates[0].share:
            break
        child = child_seed(seed, "nuisance selection", candidate.name)
        tried = correct_bias(candidate.objective, candidate.point[np.newaxis], max_corrections, child)
        if _significant(tried, result, candidate.name, child):
            kept.append((candidate.name, tried))
    return min(kept, key=lambda one: _share_of_residual(one[1], result)) if kept else None


def _significant(tried: SearchResult, before: SearchResult, name: str, seed: int) -> bool:
    """Return whether the estimate of `name` in `tried` is kept."""
    share, score = _share_of_residual(tried, before), _score(tried, name, seed)
    significant = (score >= SELECTION.certain_score and share < 1) or (
        score >= SELECTION.likely_score and share < SELECTION.likely_share
    )
    if sensor_error(name) and not _explained(tried):
        significant = significant and share < SENSOR_SELECTION.unexplained_share
    value = tried.point[tried.objective.space.coordinates.index(name)]
    least = SELECTION.least_deviation / PRIORS_PER_UNIT / widening(name)
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
    wide, start = _with_nuisances(result, names, others)
    jacobians = _jacobians(wide, start, stream(seed, "Jacobians of the score test", *names))
    residual = result.residual[: objective.channel_rows]
    own = [i for i, name in enumerate(wide.space.coordinates) if name in objective.space.coordinates]
    starts: dict[str, tuple[float, MapObjective, Array]] = {}
    for name in others:
        extended, point = _with_nuisances(result, names, (name,))
        i, column = extended.space.coordinates.index(name), wide.space.coordinates.index(name)
        if sensor_error(name):
            others_step, size, error = _linear_error(
                jacobians[:, own], jacobians[0, column], residual, len(objective.problem.channels)
            )
            step = np.insert(others_step, i, size)
        else:
            # Jacobians were taken for all at once; each is judged as if it alone were estimated too.
            kept = [
                k for k, other in enumerate(wide.space.coordinates) if other in extended.space.coordinates
            ]
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
    known = replace(result, jacobians=jacobians[:, own])
    return known, sorted(candidates, key=lambda candidate: candidate.share)


def _jacobians(objective: MapObjective, point: Array, rng: np.random.Generator) -> Array:
    """Return replicated Jacobians (n, d, channel rows) about `point` (d,), those of sensors' errors once.

    These are linear in the model's signals, and have no kinks: one central difference serves all replicates.
    """
    coordinates = objective.space.coordinates
    errors = [i for i, name in enumerate(coordinates) if sensor_error(name)]
    others = [i for i in range(len(coordinates)) if i not in errors]

    def outputs(points: Array) -> Array:
        return objective.outputs(points)[:, : objective.channel_rows]

    def of_others(points: Array) -> Array:
        whole = np.tile(point, (len(points), 1))
        whole[:, others] = points
        return outputs(whole)

    rest = Box(objective.space.lower[others], objective.space.upper[others])
    jacobians = replicated_jacobians(of_others, point[others], rest, JACOBIAN_STEP, REPLICATES, rng)
    result = np.empty((REPLICATES, len(coordinates), objective.channel_rows))
    result[:, others] = jacobians
    if errors:
        moves = JACOBIAN_STEP * np.eye(len(coordinates))[errors]
        sides = outputs(np.concatenate([point + moves, point - moves]))
        result[:, errors] = (sides[: len(errors)] - sides[len(errors) :]) / (2 * JACOBIAN_STEP)
    return result


def _linear_error(
    jacobians: Array, derivative: Array, residual: Array, channels: int
) -> tuple[Array, float, float]:
    """Return the step (d,) of the others, the size of one more coordinate's own, and its standard error.

    By regression of the `residual` (rows,) on the `derivative` (rows,) less what the other coordinates,
    `jacobians` (n, d, rows), explain of it (Frisch and Waugh 1933); the scores are as correlated as the
    sandwich covariance takes them.
    """
    mean = jacobians.mean(axis=0)
    normal = mean @ mean.T
    ridge = 1e-9 * float(np.trace(normal)) * np.eye(len(normal))
    shares = np.linalg.solve(normal + ridge, mean @ derivative)
    alone = derivative - shares @ mean
    power = max(float(alone @ alone), np.finfo(float).tiny)
    size = float(alone @ residual) / power
    scores = (alone * (residual - size * alone)).reshape(channels, -1).sum(axis=0)
    variance = float(long_run_covariance(scores[np.newaxis])[0, 0])
    return -size * shares, size, max(variance, np.finfo(float).tiny) ** 0.5 / power


def _informative(name: str) -> float:
    """Return the standard error that the data must give at most, in standard deviations of the prior."""
    return SENSOR_SELECTION.informative if sensor_error(name) else SELECTION.informative


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
        left = float(np.mean((target - factor * model) ** 2))
        if left < SENSOR_SELECTION.gross_share**2 * float(np.mean(residual**2)):
            extended, point = _with_nuisances(result, names, (name,))
            deviation = float(extended.space.nuisances.prior_deviations[-1])
            i = extended.space.coordinates.index(name)
            point[i] = (factor - 1) / float(extended.space.nuisances.meaning[-1, -1]) if deviation else 0.0
            starts[name] = np.inf, extended, point
    return starts


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


def _with_nuisances(
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
