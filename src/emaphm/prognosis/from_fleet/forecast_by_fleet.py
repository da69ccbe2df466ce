"""Changes of a unit's forecast by its fleet: recalibration, and a mixture with the pace of the units."""

from dataclasses import replace

import numpy as np

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
    # From the filter state: a replacement at the hours of the last diagnosis came after that diagnosis.
    new_at = [float(belief.new_at[columns_of_limit(limit)[0]]) for limit in times.limits]
    paths = [
        pace.path(evidence, limit, start, belief.hours)
        for limit, start in zip(times.limits, new_at, strict=True)
    ]
    fleet_population = pace.population(times.limits, belief.seed)
    if fleet_population is None:
        return times
    population, least = fleet_population
    passages = [Passages.of(*path, hours) for path, hours in zip(paths, least, strict=True)]
    if not any(passage.passed for passage in passages):
        return times
    # The name of the stream is kept, so that forecasts stay the same.
    random = stream(belief.seed, "fellows' pace", evidence.unit, belief.steps)
    count = len(pace.units)
    share = pace.shown_share * count / (count + FLEET_PACE.filter_weight)
    working = np.flatnonzero(times.first > 0)
    by_pace = random.permutation(working)[: round(share * working.size)]
    hours = times.hours.copy()
    for i, limit in enumerate(times.limits):
        ahead_of = population.passed_counts[i, int(passages[i].passed) :]
        if ahead_of.min(initial=FLEET_PACE.fewest_passed) < FLEET_PACE.fewest_passed:
            continue
        column = columns_of_limit(limit)[0]
        age, now = paths[i][0], pace.ageing_hours(evidence, column, new_at[i], belief.hours)
        hours_since = now - age[-1] if age.size else 0.0
        if _survives_beyond_population(population, i, passages[i], hours_since, random):
            return times
        consumed = pace.consumed_share(limit, level[by_pace])
        waiting = passages[i].waiting_until(now, least[i])
        drawn = remaining_hours(population, i, waiting, consumed, random)
        hours[i, by_pace] = drawn / pace.ageing_rate(evidence, column, belief.hours, ahead)
    for side in times.sides:
        rows = np.array(side)[:, np.newaxis]
        hours[rows, by_pace] = _ordered_by_limit(hours[rows, by_pace])
    return replace(times, hours=hours)


def _is_usable(pace: FleetPaceModel, limit: Limit, unit: Evidence, belief: Belief) -> bool:
    """Return whether a new unit meets the limit, on a level that the last diagnosis determines."""
    if limit.component is None or pace.full_margin(limit) <= 0:
        return False
    if belief.surprise[columns_of_limit(limit)].max() > FLEET_PACE.largest_surprise:
        return False
    last = [diagnosis for diagnosis in unit.used if diagnosis.hours <= belief.hours][-1:]
    return all(pace.is_known(diagnosis, limit) for diagnosis in last)


def _survives_beyond_population(
    population: PopulationDraws, component: int, last: Passages, since: float, random: np.random.Generator
) -> bool:
    """Return whether a unit has worked longer `since` its `last` diagnosis [h] than the population would.

    The drawn lives start below the diagnosed share by the largest error of a usable diagnosis.
    """
    if since <= 0:
        return False
    share = np.full(FLEET_PACE.survival_draws, last.share - FLEET_PACE.largest_error)
    remaining = remaining_hours(population, component, last, share, random)
    return bool(np.mean(remaining > since) < FLEET_PACE.least_survival)


def _ordered_by_limit(hours: Array) -> Array:
    """Return `hours` (k, n) of limits on one side of a level, the tightest first, ordered as on n paths.

    A path that passes one limit early passes all limits early, and a wider limit after a tighter one.
    """
    rank = hours[0].argsort().argsort()
    return np.asarray(np.maximum.accumulate(np.sort(hours, axis=1)[:, rank], axis=0))
