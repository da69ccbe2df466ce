"""Changes of a unit's forecast by its fleet: recalibration, and a mixture with the pace of the units."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.from_fleet.fleet_pace import FLEET_PACE, FleetPaceModel, columns_of_limit
from emaphm.prognosis.from_fleet.pace_population import PopulationDraws, remaining_hours
from emaphm.prognosis.from_fleet.passages import Passages
from emaphm.prognosis.requirements.failure_times import FailureTimes
from emaphm.prognosis.requirements.margins import Limit
from emaphm.prognosis.stress import Stress
from emaphm.random_streams import stream


def by_fleet(
    times: FailureTimes, level: Array, belief: Belief, evidence: Evidence, ahead: Stress | None
) -> FailureTimes:
    """Return the failure `times` of a forecast from `belief`, changed by the fleet.

    They are recalibrated by the outcomes of past predictions, and then mixed with the failure times from the
    pace of the units (`mixed_with_pace`). `level` (n, 8) are the initial levels of the paths, `evidence` is
    that of the unit, `ahead` the future stress.
    """
    recalibration, pace = belief.prior.recalibration, belief.prior.fleet_pace
    if recalibration is not None:
        times = replace(times, hours=recalibration.corrected(times.hours, belief.age))
    return times if pace is None else mixed_with_pace(times, pace, level, belief, evidence, ahead)


def mixed_with_pace(
    times: FailureTimes,
    pace: FleetPaceModel,
    level: Array,
    belief: Belief,
    evidence: Evidence,
    ahead: Stress | None,
) -> FailureTimes:
    """Return failure times of a forecast, with the share √f n / (n + 8) of the working paths from the pace.

    n is the number of units, f the share of units that have failed. The forecast is returned unchanged if

    - a limit is on a measure, or a new unit is beyond it,
    - there are fewer than 8 units, or no unit has passed a step,
    - the last diagnosis has a standard error above 5 % of a full margin, or is probably an outlier,
    - the unit has passed no step towards any limit,
    - the unit has worked longer since its last diagnosis than 95 % of the population would,
    - or most paths have failed.

    The times of one limit are unchanged if fewer than 4 lives have passed a step that is ahead of it.

    Parameters
    ----------
    times
        The filter's forecast.
    pace
        Pace of the fleet's units.
    level
        Initial levels of the paths, (n, 8): filtered levels, because the last diagnosis has an error.
    belief
        Filter state of the forecast; its hours and seed are used.
    evidence
        Evidence on the unit; diagnoses up to the hours of the filter state are used.
    ahead
        The future stress, as in `prognose`.
    """
    if len(pace.units) < FLEET_PACE.fewest_units or np.median(times.first) == 0:
        return times
    if not all(_is_usable(pace, limit, evidence, belief) for limit in times.limits):
        return times
    fleet_population = pace.population(times.limits, belief.seed)
    if fleet_population is None:
        return times
    population, least = fleet_population
    lives = [
        _PresentLife.of(pace, limit, hours, evidence, belief)
        for limit, hours in zip(times.limits, least, strict=True)
    ]
    if not any(life.passages.passed for life in lives):
        return times
    # The name of the stream is kept, so that forecasts stay the same.
    random = stream(belief.seed, "fellows' pace", evidence.unit, belief.steps)
    chosen = _paths_by_pace(times, pace, random)
    stress = pace.stress_ahead(
        evidence, belief.hours, ahead, chosen.size, stream(belief.seed, "stress ahead", evidence.unit)
    )
    hours = times.hours.copy()
    for i, (limit, life) in enumerate(zip(times.limits, lives, strict=True)):
        lives_ahead = population.passed_counts[i, int(life.passages.passed) :]
        if lives_ahead.min(initial=FLEET_PACE.fewest_passed) < FLEET_PACE.fewest_passed:
            continue
        if _survives_beyond_population(population, i, life, random):
            return times
        consumed = pace.consumed_share(limit, level[chosen])
        waiting = life.passages.waiting_until(life.age, least[i])
        ageing = remaining_hours(population, i, waiting, consumed, random)
        hours[i, chosen] = stress.flight_hours(ageing, pace.exponents[columns_of_limit(limit)[0]])
    for side in times.sides:
        rows = np.array(side)[:, np.newaxis]
        hours[rows, chosen] = _ordered_by_limit(hours[rows, chosen])
    return replace(times, hours=hours)


class _PresentLife(NamedTuple):
    """The life of the component that a limit is on, up to the hours of a belief.

    `passages` up to its last diagnosis; `age`, and the time `since` that diagnosis, in hours of ageing [h].
    """

    passages: Passages
    age: float
    since: float

    @classmethod
    def of(
        cls, pace: FleetPaceModel, limit: Limit, least: float, unit: Evidence, belief: Belief
    ) -> "_PresentLife":
        """Return the life towards `limit` of a unit; no step is shorter than `least` [h]."""
        column = columns_of_limit(limit)[0]
        # From the belief: a replacement at the hours of the last diagnosis came after that diagnosis.
        new_at = float(belief.new_at[column])
        ages, shares = pace.path(unit, limit, new_at, belief.hours)
        age = pace.ageing_hours(unit, column, new_at, belief.hours)
        since = age - float(ages[-1]) if ages.size else 0.0
        return cls(Passages.of(ages, shares, least), age, since)


def _paths_by_pace(
    times: FailureTimes, pace: FleetPaceModel, random: np.random.Generator
) -> NDArray[np.intp]:
    """Return which of the working paths are forecast by the pace, drawn without replacement."""
    count = len(pace.units)
    share = pace.shown_share * count / (count + FLEET_PACE.filter_weight)
    working = np.flatnonzero(times.first > 0)
    return random.permutation(working)[: round(share * working.size)]


def _is_usable(pace: FleetPaceModel, limit: Limit, unit: Evidence, belief: Belief) -> bool:
    """Return whether a new unit meets the limit, on a level that the last diagnosis determines."""
    if limit.component is None or pace.full_margin(limit) <= 0:
        return False
    if belief.surprise[columns_of_limit(limit)].max() > FLEET_PACE.largest_surprise:
        return False
    last = [diagnosis for diagnosis in unit.used if diagnosis.hours <= belief.hours][-1:]
    return all(pace.is_known(diagnosis, limit) for diagnosis in last)


def _survives_beyond_population(
    population: PopulationDraws, component: int, life: _PresentLife, random: np.random.Generator
) -> bool:
    """Return whether a unit has worked longer since its last diagnosis than the population would.

    The drawn lives start below the diagnosed share by the largest error of a usable diagnosis.
    """
    if life.since <= 0:
        return False
    share = np.full(FLEET_PACE.survival_draws, life.passages.share - FLEET_PACE.largest_error)
    remaining = remaining_hours(population, component, life.passages, share, random)
    return bool(np.mean(remaining > life.since) < FLEET_PACE.least_survival)


def _ordered_by_limit(hours: Array) -> Array:
    """Return `hours` (k, n) of limits on one side of a level, the tightest first, ordered as on n paths.

    A path that passes one limit early passes all limits early, and a wider limit after a tighter one.
    """
    rank = hours[0].argsort().argsort()
    return np.asarray(np.maximum.accumulate(np.sort(hours, axis=1)[:, rank], axis=0))
