"""Prognosis of a unit: distribution of the remaining useful life from its diagnoses, and advice."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.errors import PrognosisError
from emaphm.prognosis.advice import (
    PRIOR_ALONE,
    Advice,
    Costs,
    advice,
    without_followed_rates,
    without_new_diagnoses,
    without_observed_violation,
)
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.columns import columns_of
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.filter.following import Followed, follow
from emaphm.prognosis.forecast import Paths, UnitDraws, drawn_states, paths
from emaphm.prognosis.from_fleet.forecast_by_fleet import by_fleet
from emaphm.prognosis.notes.gathering import notes_on
from emaphm.prognosis.notes.rates import rates_too_fast
from emaphm.prognosis.prior import NEW, Prior
from emaphm.prognosis.requirements import Requirements, vectors_of
from emaphm.prognosis.requirements.failure_times import FailureTimes, failure_times, responsible
from emaphm.prognosis.requirements.found_failed import found_failed
from emaphm.prognosis.result import Prognosis
from emaphm.prognosis.settings import CONSTANT, FILTER, FORECAST, ForecastSettings
from emaphm.prognosis.stress import Stress, ageing_ahead

if TYPE_CHECKING:
    from emaphm.history import Failure

MOST_PAST, PAST_PATHS = 12, 250
"""Largest number of earlier forecasts in a figure of the RUL against time; paths of each of them if a
requirement is a measure."""

LONGEST_HORIZON = 1e6
"""Longest horizon of a forecast [h]."""


@dataclass(frozen=True)
class Question:
    """Inputs of a prognosis apart from the evidence: horizon, accepted risk, costs and future stress.

    Parameters
    ----------
    horizon
        Flight hours from now on, for which the probability of failure is computed [h].
    risk
        Largest accepted probability of failure, for the advice without costs.
    ahead
        The future stress. A value that is left out continues as in the recorded past.

    Raises
    ------
    PrognosisError
        The horizon is not above 0, or the risk is not a probability.
    """

    horizon: float = 1000.0
    risk: float = 0.05
    costs: Costs | None = None
    ahead: Stress | None = None

    def __post_init__(self) -> None:
        if not 0 < self.horizon <= LONGEST_HORIZON:
            raise PrognosisError(
                f"a horizon of {self.horizon:.9g} h: give hours above 0, {LONGEST_HORIZON:g} at most"
            )
        if not 0 < self.risk < 1:
            raise PrognosisError(
                f"a risk of {self.risk:g} is not a probability: give a number between 0 and 1"
            )


DEFAULT_QUESTION = Question()


def prognose(
    evidence: Evidence,
    actuator: Actuator,
    question: Question = DEFAULT_QUESTION,
    *,
    prior: Prior | None = None,
    seed: int = 0,
    settings: ForecastSettings | None = None,
    keep_past: bool = True,
) -> Prognosis:
    """Return the remaining useful life of a unit against the requirements of `actuator`.

    Parameters
    ----------
    evidence
        The unit's diagnoses and replacements.
    actuator
        Its requirements define a failure. Without requirements, a failure is a level of 1 of a component
        other than the gain.
    question
        The horizon [h], the accepted risk, costs and the future stress.
    prior
        Prior of the degradation: by default the general prior; `fleet_prior` learns a prior from other units.
    seed, settings
        Seed of the random streams; number and duration of the forecast paths, by default `FORECAST`.
    keep_past
        Whether the filter states at up to `MOST_PAST` earlier diagnoses are kept, 2 MB each, for a figure of
        the RUL against time.

    Raises
    ------
    PrognosisError
        A diagnosis cannot be used, or a new actuator violates a requirement, so that its life would be 0.
    MethodError
        The averaged model did not stay finite.
    """
    prior, settings = (prior or Prior()).of(actuator), _reaching(settings or FORECAST, question.horizon)
    requirements = Requirements(actuator)
    requirements.check_new()
    kept = _plotted_diagnoses(evidence) if keep_past else {len(evidence.used) - 1}
    filtering = FILTER.for_updates(len(evidence.used))
    followed = follow(evidence, prior, seed=seed, settings=filtering, past=kept)
    forecast_paths, forecast = _forecast(followed.belief, evidence, requirements, settings, question.ahead)
    times = by_fleet(forecast, forecast_paths.level[0], followed.belief, evidence, question.ahead)
    limit = times.commonest
    component = None if limit is None else responsible(forecast_paths, forecast, limit, requirements)
    new_at = followed.belief.new_at[columns_of(component)[0]] if component else 0.0
    level = forecast_paths.level[0]
    diagnosed_level = _level_at_newest_diagnosis(followed, level)
    result = Prognosis(
        evidence=evidence,
        actuator=actuator,
        horizon=question.horizon,
        values=requirements.values(vectors_of(level, actuator)),
        times=times,
        paths=forecast_paths,
        component=component,
        limit=None if limit is None else times.limits[limit],
        advice=_advice(
            evidence,
            times.first,
            question,
            age=evidence.hours - float(new_at),
            observed=_violates(diagnosed_level, followed.belief, evidence, requirements),
        ),
        belief=followed.belief,
        past=followed.past if keep_past else (),
        seed=seed,
        ahead=question.ahead,
        notes=notes_on(
            evidence,
            followed.belief,
            level,
            diagnosed_level,
            times,
            requirements,
            prior,
            component=component,
            ahead=question.ahead,
        ),
    )
    return result if evidence.unrepaired is None else _as_failed(result, evidence.unrepaired)


def _level_at_newest_diagnosis(followed: Followed, level: Array) -> Array:
    """Return samples (n, 8) of the levels after the newest used diagnosis; `level` are the present levels."""
    newest = followed.past[-1] if followed.past else followed.belief
    # If nothing came after it, the present levels are drawn from the same filter state.
    return level if newest is followed.belief else drawn_states(newest, len(level)).level


def _violates(level: Array, belief: Belief, evidence: Evidence, requirements: Requirements) -> bool:
    """Return whether the median of the levels (n, 8) after the newest diagnosis violates a requirement.

    Components replaced since then count as new; without a diagnosis, nothing is violated.
    """
    if not evidence.used:
        return False
    is_replaced = (belief.new_at >= evidence.used[-1].hours) & (belief.new_at > 0)
    newest = np.where(is_replaced, NEW, np.median(level, axis=0))
    vectors = vectors_of(newest[np.newaxis], requirements.actuator)
    return bool(np.any(requirements.margins(vectors) < 0))


def _advice(evidence: Evidence, rul: Array, question: Question, *, age: float, observed: bool) -> Advice:
    """Return the advice for a sample of the RUL [h], which uses explained diagnoses alone.

    `observed` is whether the newest of them shows a violation.
    """
    given = advice(rul, question.horizon, risk=question.risk, age=age, costs=question.costs)
    if not observed:
        given = without_observed_violation(given, evidence.used[-1].hours if evidence.used else None)
    newest, failed = evidence.unexplained, float(np.mean(rul == 0))
    rates = rates_too_fast(evidence)
    if rates:
        given = without_followed_rates(given, rates, failed)
    if newest is None:
        return given
    if not evidence.used:
        return without_new_diagnoses(given, newest, failed, source=PRIOR_ALONE)
    return without_new_diagnoses(given, newest, failed)


def _as_failed(forecast: Prognosis, failure: "Failure") -> Prognosis:
    """Return the prognosis of a failed unit: RUL 0, and the failed component that a shop found, if any.

    Levels and other requirements are kept from the forecast.
    """
    times, component, limit = found_failed(forecast.times, failure.components)
    since = f"failed at {failure.hours:,.9g} h and was neither repaired nor flown since"
    note = f"the unit {since}: it has no remaining useful life"
    if component is None:
        most_likely = (
            f"; the most likely component according to the diagnoses: {forecast.cause}"
            if forecast.cause
            else ""
        )
        note += f"; no finding in the history states the cause{most_likely}"
    return replace(
        forecast,
        times=times,
        component=component,
        limit=limit,
        advice=Advice("replace before", 0.0, 1.0, f"it {since}"),
        notes=(note, *forecast.notes),
    )


def past_rul_forecasts(prognosis: Prognosis) -> list[tuple[float, Array]]:
    """Return the RUL forecast at the diagnoses whose filter states were kept: pairs of hours, samples [h].

    If a requirement is a measure, fewer paths are used, because each value needs a run of the model.
    """
    settings = _reaching(FORECAST, prognosis.horizon)
    if any(limit.component is None for limit in prognosis.times.limits):
        settings = replace(settings, paths=PAST_PATHS)
    return rul_forecasts(prognosis.past, prognosis.evidence, prognosis.actuator, prognosis.ahead, settings)


def _reaching(settings: ForecastSettings, horizon: float) -> ForecastSettings:
    """Return settings of a forecast over at least twice the horizon [h]."""
    return replace(settings, longest_hours=max(settings.longest_hours, 2 * horizon))


def _plotted_diagnoses(evidence: Evidence) -> set[int]:
    """Return indices of up to `MOST_PAST` used diagnoses, evenly spaced from the first to the last."""
    count = len(evidence.used)
    return set(np.linspace(0, count - 1, min(MOST_PAST, count)).astype(int).tolist())


def rul_forecasts(
    beliefs: Sequence[Belief],
    evidence: Evidence,
    actuator: Actuator,
    ahead: Stress | None = None,
    settings: ForecastSettings | None = None,
) -> list[tuple[float, Array]]:
    """Return the RUL forecast from each of the filter states `beliefs`: pairs of hours, samples [h].

    `ahead` is the future stress and `settings` are those of the forecast, as in `prognose`.
    """
    requirements, settings = Requirements(actuator), settings or FORECAST
    forecasts = []
    for belief in beliefs:
        forecast_paths, times = _forecast(belief, evidence, requirements, settings, ahead)
        forecasts.append(
            (belief.hours, by_fleet(times, forecast_paths.level[0], belief, evidence, ahead).first)
        )
    return forecasts


def uncorrected(
    beliefs: Sequence[Belief], evidence: Evidence, actuator: Actuator, settings: ForecastSettings
) -> list[FailureTimes]:
    """Return the failure times of the paths from each of one or more filter states `beliefs` of a unit.

    Recalibration and pace of the fleet are not applied. The paths of all filter states are computed together.
    """
    states = [_state(belief, evidence, settings) for belief in beliefs]
    paces = [
        np.broadcast_to(pace_ahead(state, belief, evidence, None), state.law.shape)
        for state, belief in zip(states, beliefs, strict=True)
    ]
    fields = {name: np.concatenate([getattr(state, name) for state in states]) for name in vars(states[0])}
    seed = beliefs[0].seed
    forecast_paths = _paths(UnitDraws(**fields), beliefs[0], evidence, np.concatenate(paces), settings)
    times = failure_times(forecast_paths, Requirements(actuator), seed=seed)
    hours_by_state = np.split(times.hours, len(beliefs), axis=1)
    return [FailureTimes(times.limits, part) for part in hours_by_state]


def _forecast(
    belief: Belief,
    evidence: Evidence,
    requirements: Requirements,
    settings: ForecastSettings,
    ahead: Stress | None,
) -> tuple[Paths, FailureTimes]:
    """Return the paths from a filter state and the times at which they fail the requirements."""
    state = _state(belief, evidence, settings)
    pace = pace_ahead(state, belief, evidence, ahead)
    forecast_paths = _paths(state, belief, evidence, pace, settings)
    return forecast_paths, failure_times(forecast_paths, requirements, seed=belief.seed)


def _state(belief: Belief, evidence: Evidence, settings: ForecastSettings) -> UnitDraws:
    """Return states of the unit drawn from the filter; components never diagnosed are assumed healthy."""
    state, undiagnosed = drawn_states(belief, settings.paths), ~evidence.seen
    return replace(
        state,
        law=np.where(undiagnosed, CONSTANT, state.law).astype(np.int8),
        level=np.where(undiagnosed, NEW, state.level),
        rate=np.where(undiagnosed, 0.0, state.rate),
    )


def _paths(
    state: UnitDraws, belief: Belief, evidence: Evidence, pace: Array | float, settings: ForecastSettings
) -> Paths:
    """Return the paths from `state`; levels of components never diagnosed stay healthy."""
    forecast_paths, undiagnosed = (
        paths(state, belief.prior, seed=belief.seed, pace=pace, settings=settings),
        ~evidence.seen,
    )
    if undiagnosed.any():
        forecast_paths.level[:, :, undiagnosed] = NEW[undiagnosed]
        forecast_paths.noise[:, :, undiagnosed] = 0.0
    return forecast_paths


def pace_ahead(state: UnitDraws, belief: Belief, evidence: Evidence, ahead: Stress | None) -> Array | float:
    """Return the hours by which the components of `state` age in a future hour, (n, 8) or one number.

    The stress is `ahead`; a value that it leaves out continues as recorded up to the filter state.
    """
    prior, stresses = belief.prior, evidence.stresses
    return ageing_ahead(
        stresses, prior.reference, belief.hours, state.exponents, ahead, prior.missions.reference_weight
    )
