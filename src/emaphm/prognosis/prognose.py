"""Prognosis of a unit: from its diagnoses to the distribution of its remaining useful life, and advice."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.errors import PrognosisError
from emaphm.prognosis.advice import Advice, Costs, advice, without_new_diagnoses
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.columns import columns_of
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.filter.following import follow
from emaphm.prognosis.forecast import Paths, UnitDraws, drawn_states, paths
from emaphm.prognosis.from_fleet.forecast_by_fleet import by_fleet
from emaphm.prognosis.notes.gathering import notes_on
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
"""Most earlier forecasts in a figure of the RUL against time, and paths of each where measures end them."""

LONGEST_HORIZON = 1e6
"""Longest horizon of a forecast [h]."""


@dataclass(frozen=True)
class Question:
    """What is asked of a prognosis: how far is planned, and what a failure may cost.

    Parameters
    ----------
    horizon
        Flight hours from now on, within which the probability of failure is asked [h].
    risk
        Largest accepted probability of failure, for the advice without costs.
    ahead
        The stress that is to come. What it leaves out stays as in the past, as far as that was recorded.

    Raises
    ------
    PrognosisError
        The horizon is not above 0, or the risk is no probability.
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
            raise PrognosisError(f"a risk of {self.risk:g} is no probability: give one between 0 and 1")


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
        Its requirements define a failure. Without any, it is a level of 1 of a component other than the gain.
    question
        The horizon [h], the accepted risk, costs and the stress to come.
    prior
        Prior of the degradation: the general one where left out; `fleet_prior` learns one of other units.
    seed, settings
        Source of all randomness; how many paths are forecast, and how far, `FORECAST` where left out.
    keep_past
        Whether the beliefs at up to `MOST_PAST` earlier diagnoses are kept, 2 MB each, for a figure of the
        RUL against time.

    Raises
    ------
    PrognosisError
        A diagnosis cannot be used, or a new actuator violates a requirement: a life would begin with its end.
    MethodError
        The averaged model did not stay finite.
    """
    prior, settings = (prior or Prior()).of(actuator), _reaching(settings or FORECAST, question.horizon)
    requirements = Requirements(actuator)
    requirements.check_new()
    kept = _shown(evidence) if keep_past else {len(evidence.used) - 1}
    filtering = FILTER.for_updates(len(evidence.used))
    followed = follow(evidence, prior, seed=seed, settings=filtering, past=kept)
    made, forecast = _forecast(followed.belief, evidence, requirements, settings, question.ahead)
    times = by_fleet(forecast, made.level[0], followed.belief, evidence, question.ahead)
    limit = times.commonest
    component = None if limit is None else responsible(made, forecast, limit, requirements)
    new_at = followed.belief.new_at[columns_of(component)[0]] if component else 0.0
    result = Prognosis(
        evidence=evidence,
        actuator=actuator,
        horizon=question.horizon,
        values=requirements.values(vectors_of(made.level[0], actuator)),
        times=times,
        paths=made,
        component=component,
        limit=None if limit is None else times.limits[limit],
        advice=_advice(evidence, times.first, question, age=evidence.hours - float(new_at)),
        belief=followed.belief,
        past=followed.past if keep_past else (),
        seed=seed,
        ahead=question.ahead,
        notes=notes_on(
            evidence,
            followed,
            made.level[0],
            times,
            requirements,
            prior,
            component=component,
            ahead=question.ahead,
        ),
    )
    return result if evidence.unrepaired is None else _as_failed(result, evidence.unrepaired)


def _advice(evidence: Evidence, rul: Array, question: Question, *, age: float) -> Advice:
    """Return the advice for a sample of the RUL [h], which follows from explained diagnoses alone."""
    given = advice(rul, question.horizon, risk=question.risk, age=age, costs=question.costs)
    newest = evidence.unexplained
    return given if newest is None else without_new_diagnoses(given, newest, float(np.mean(rul == 0)))


def _as_failed(forecast: Prognosis, failure: "Failure") -> Prognosis:
    """Return the prognosis of a unit that has failed: no life left, by what a shop found, if it did.

    Levels and other requirements stay as forecast.
    """
    times, component, limit = found_failed(forecast.times, failure.components)
    since = f"failed at {failure.hours:,.9g} h and was neither repaired nor flown since"
    note = f"the unit {since}: it has no remaining useful life"
    if component is None:
        likeliest = f"; the likeliest by its diagnoses: {forecast.cause}" if forecast.cause else ""
        note += f"; by what, no finding in the history says{likeliest}"
    return replace(
        forecast,
        times=times,
        component=component,
        limit=limit,
        advice=Advice("replace before", 0.0, 1.0, f"it {since}"),
        notes=(note, *forecast.notes),
    )


def past_lives(prognosis: Prognosis) -> list[tuple[float, np.ndarray]]:
    """Return the RUL as forecast at the diagnoses whose beliefs were kept: pairs of hours and samples [h].

    By fewer paths where a requirement is a measure, of which each value takes a run of the model.
    """
    settings = _reaching(FORECAST, prognosis.horizon)
    if any(limit.component is None for limit in prognosis.times.limits):
        settings = replace(settings, paths=PAST_PATHS)
    return lives(prognosis.past, prognosis.evidence, prognosis.actuator, prognosis.ahead, settings)


def _reaching(settings: ForecastSettings, horizon: float) -> ForecastSettings:
    """Return the settings of a forecast that goes beyond the horizon [h]."""
    return replace(settings, longest_hours=max(settings.longest_hours, 2 * horizon))


def _shown(evidence: Evidence) -> set[int]:
    """Return the numbers of up to `MOST_PAST` used diagnoses, evenly from the first to the last."""
    count = len(evidence.used)
    return set(np.linspace(0, count - 1, min(MOST_PAST, count)).astype(int).tolist())


def lives(
    beliefs: Sequence[Belief],
    evidence: Evidence,
    actuator: Actuator,
    ahead: Stress | None = None,
    settings: ForecastSettings | None = None,
) -> list[tuple[float, np.ndarray]]:
    """Return the RUL as forecast from each of the `beliefs` of a unit: pairs of hours and samples [h].

    `ahead` is the stress to come and `settings` are how it is forecast, as in `prognose`.
    """
    requirements, settings = Requirements(actuator), settings or FORECAST
    found = []
    for belief in beliefs:
        made, times = _forecast(belief, evidence, requirements, settings, ahead)
        found.append((belief.hours, by_fleet(times, made.level[0], belief, evidence, ahead).first))
    return found


def uncorrected(
    beliefs: Sequence[Belief], evidence: Evidence, actuator: Actuator, settings: ForecastSettings
) -> list[FailureTimes]:
    """Return when the paths from each of the `beliefs` of a unit, one or more, fail its requirements.

    The corrections that the fleet's record suggests are left out. The paths of all are followed together.
    """
    states = [_state(belief, evidence, settings) for belief in beliefs]
    paces = [
        np.broadcast_to(pace_ahead(state, belief, evidence, None), state.law.shape)
        for state, belief in zip(states, beliefs, strict=True)
    ]
    fields = {name: np.concatenate([getattr(state, name) for state in states]) for name in vars(states[0])}
    seed = beliefs[0].seed
    made = _paths(UnitDraws(**fields), beliefs[0], evidence, np.concatenate(paces), settings)
    times = failure_times(made, Requirements(actuator), seed=seed)
    parts = np.split(times.hours, len(beliefs), axis=1)
    return [FailureTimes(times.limits, part) for part in parts]


def _forecast(
    belief: Belief,
    evidence: Evidence,
    requirements: Requirements,
    settings: ForecastSettings,
    ahead: Stress | None,
) -> tuple[Paths, FailureTimes]:
    state = _state(belief, evidence, settings)
    pace = pace_ahead(state, belief, evidence, ahead)
    made = _paths(state, belief, evidence, pace, settings)
    return made, failure_times(made, requirements, seed=belief.seed)


def _state(belief: Belief, evidence: Evidence, settings: ForecastSettings) -> UnitDraws:
    """Return possible states of the unit, drawn from a belief; components never diagnosed are healthy."""
    state, hidden = drawn_states(belief, settings.paths), ~evidence.seen
    return replace(
        state,
        law=np.where(hidden, CONSTANT, state.law).astype(np.int8),
        level=np.where(hidden, NEW, state.level),
        rate=np.where(hidden, 0.0, state.rate),
    )


def _paths(
    state: UnitDraws, belief: Belief, evidence: Evidence, pace: Array | float, settings: ForecastSettings
) -> Paths:
    made, hidden = paths(state, belief.prior, seed=belief.seed, pace=pace, settings=settings), ~evidence.seen
    if hidden.any():
        made.level[:, :, hidden] = NEW[hidden]
        made.noise[:, :, hidden] = 0.0
    return made


def pace_ahead(state: UnitDraws, belief: Belief, evidence: Evidence, ahead: Stress | None) -> Array | float:
    """Return by how many hours the components of `state` age in an hour to come, (n, 8) or one number.

    Under the stress `ahead`, and what it leaves out as recorded up to the belief.
    """
    return ageing_ahead(evidence.stresses, belief.prior.reference, belief.hours, state.exponents, ahead)
