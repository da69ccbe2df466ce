"""Failure times of a unit by the pace of the other units, as a mixture with the forecast of the filter."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array
from emaphm.memory import Memory
from emaphm.prognosis.columns import columns_of, level_of
from emaphm.prognosis.from_fleet.fingerprint import fingerprint
from emaphm.prognosis.from_fleet.pace_population import PopulationDraws, remaining_hours, sampled_population
from emaphm.prognosis.from_fleet.passages import Passages, least_hours
from emaphm.prognosis.stress import Stress, StressReference, ageing_ahead, exposure
from emaphm.random_streams import stream

if TYPE_CHECKING:
    from collections.abc import Sequence

    from emaphm.prognosis.belief import Belief
    from emaphm.prognosis.evidence import Evidence, Observation
    from emaphm.prognosis.requirements.failure_times import FailureTimes
    from emaphm.prognosis.requirements.margins import Limit


@dataclass(frozen=True)
class FleetPaceSettings:
    """When the pace of other units forecasts a unit, and how much it weighs against the filter.

    The pace is used from `fewest_units` units on; it was measured with 26 and 30. A limit's failure times
    come from it if at least `fewest_passed` lives have passed each step that is ahead: from fewer, a step
    that nobody has passed would be as long as the last one that somebody has.

    The filter's forecast weighs as much as `filter_weight` units, because a fleet of 30 has not shown all
    that may happen. With 2, the 90 % intervals contained the truth in 83 % of the cases late in life, of 109
    synthetic units; with 8, in 86 % (`python -m emaphm.study.fleet FOLDER` makes such units).

    A diagnosis whose standard error is above `largest_error` of the full margin does not say which step a
    component is in. A diagnosis that is an outlier or a jump with a probability above `largest_surprise` is
    not used: the pace takes it as stated.

    A unit that has worked on since its last diagnosis follows another pace if the population gives that a
    probability below `least_survival`, of `survival_draws` lives: right to 1 %, one standard error.
    """

    fewest_units: int = 8
    fewest_passed: int = 4
    filter_weight: float = 8.0
    largest_error: float = 0.05
    largest_surprise: float = 0.5
    least_survival: float = 0.05
    survival_draws: int = 400


FLEET_PACE = FleetPaceSettings()

NO_LIFE = Passages.of(np.zeros(0), np.zeros(0))
"""Takes the place of a life that a component did not have, where another component had one."""

DegradationPath = tuple[Array, Array]
"""Ages (n,) [h] of a component at its diagnoses, and the consumed shares of its margin there (n,) [-]."""


class _FleetPopulation(NamedTuple):
    """The population of paces to some limits, and the least hours of a step to each limit [h]."""

    population: PopulationDraws
    least: tuple[float, ...]


POPULATIONS: Memory[_FleetPopulation | None] = Memory(40)


@dataclass(frozen=True, eq=False)
class FleetPaceModel:
    """Pace of `units` towards limits, from their diagnoses; `new` is the level of a new unit, (8,).

    The consumed share of a margin is 0 at the level of a new unit and 1 at the limit. Hours are those at the
    stress `reference`, with `exponents` (8, 3) for each component.
    """

    units: "Sequence[Evidence]"
    new: Array
    reference: StressReference | None
    exponents: Array

    def mixture_with(
        self,
        times: "FailureTimes",
        level: Array,
        belief: "Belief",
        evidence: "Evidence",
        ahead: Stress | None,
    ) -> "FailureTimes":
        """Return failure times of a forecast, with √f n / (n + 8) of the working paths by the fleet's pace.

        n is the number of units, f the share of them that has failed. The forecast is returned unchanged if

        - a limit is on a measure, or a new unit is beyond it,
        - there are fewer than 8 units, or no unit has passed a step,
        - the last diagnosis knows a level worse than to 5 % of its full margin, or is probably an outlier,
        - the unit has passed no step towards any limit,
        - the unit has worked longer since its last diagnosis than 95 % of the population would,
        - or most paths have failed.

        The times of one limit are unchanged if fewer than 4 lives have passed a step that is ahead of it.

        Parameters
        ----------
        times
            The filter's forecast.
        level
            Where the paths begin, (n, 8): the believed levels, because the last diagnosis alone has an error.
        belief
            The belief that the forecast was made from; its hours and seed are used.
        evidence
            Of the unit; diagnoses up to the hours of the belief count.
        ahead
            The stress to come, as in `prognose`.
        """
        if len(self.units) < FLEET_PACE.fewest_units or np.median(times.first) == 0:
            return times
        if not all(self._is_usable(one, evidence, belief) for one in times.limits):
            return times
        # From the belief: a replacement at the hours of the last diagnosis came after that diagnosis.
        new_at = [float(belief.new_at[_columns(one)[0]]) for one in times.limits]
        paths = [
            self._path(evidence, one, start, belief.hours)
            for one, start in zip(times.limits, new_at, strict=True)
        ]
        found = self._population(times.limits, belief.seed)
        if found is None:
            return times
        population, least = found
        passages = [Passages.of(*path, hours) for path, hours in zip(paths, least, strict=True)]
        if not any(one.passed for one in passages):
            return times
        # The name of the stream is kept, so that forecasts stay what they were.
        random = stream(belief.seed, "fellows' pace", evidence.unit, belief.steps)
        count = len(self.units)
        share = self._shown_share * count / (count + FLEET_PACE.filter_weight)
        working = np.flatnonzero(times.first > 0)
        chosen = random.permutation(working)[: round(share * working.size)]
        hours = times.hours.copy()
        for i, limit in enumerate(times.limits):
            ahead_of = population.passed_counts[i, int(passages[i].passed) :]
            if ahead_of.min(initial=FLEET_PACE.fewest_passed) < FLEET_PACE.fewest_passed:
                continue
            column = _columns(limit)[0]
            age, now = paths[i][0], self._ageing_hours(evidence, column, new_at[i], belief.hours)
            since = now - age[-1] if age.size else 0.0
            if _survives_beyond_population(population, i, passages[i], since, random):
                return times
            consumed = self._consumed_share(limit, level[chosen])
            waiting = passages[i].waiting_until(now, least[i])
            drawn = remaining_hours(population, i, waiting, consumed, random)
            hours[i, chosen] = drawn / self._ageing_rate(evidence, column, belief.hours, ahead)
        for side in times.sides:
            rows = np.array(side)[:, np.newaxis]
            hours[rows, chosen] = _ordered_by_limit(hours[rows, chosen])
        return replace(times, hours=hours)

    @cached_property
    def _shown_share(self) -> float:
        """How far the pace is that of all units: as long as some work, the last steps are those of the fast.

        √f, f being the share of the units that have failed. Of 200 made-up units with many laws and lives of
        500 to 8,000 h, 30 of 100 failed, the 90 % intervals of 50 held 37 times without it, 46 times with it;
        of 168 units of alike fleets, 159 and 163 times.
        """
        return float(np.sqrt(np.mean([bool(one.failures) for one in self.units])))

    @cached_property
    def _keys(self) -> list[str]:
        return [fingerprint(one) for one in self.units]

    def _is_usable(self, limit: "Limit", unit: "Evidence", belief: "Belief") -> bool:
        """Return whether a limit is on a level that a new unit holds and that the last diagnosis knows."""
        if limit.component is None or self._full_margin(limit) <= 0:
            return False
        if belief.surprise[_columns(limit)].max() > FLEET_PACE.largest_surprise:
            return False
        last = [one for one in unit.used if one.hours <= belief.hours][-1:]
        return all(self._is_known(one, limit) for one in last)

    def _is_known(self, one: "Observation", limit: "Limit") -> bool:
        """Return whether a diagnosis knows a level well enough to say which step the component is in."""
        columns = _columns(limit)
        error = np.sqrt(np.diag(one.covariance)[columns].max())
        return bool(one.seen[columns].all() and error <= FLEET_PACE.largest_error * self._full_margin(limit))

    def _population(self, limits: "tuple[Limit, ...]", seed: int) -> _FleetPopulation | None:
        """Return the population of paces to each of the `limits`; None if no unit has shown any pace."""
        bounds = [(one.component, one.bound, one.upper) for one in limits]

        def computed() -> _FleetPopulation | None:
            paths = [self._paths_of(one, limits) for one in self.units]
            lives = [[life for of_unit in paths for life in of_unit[i]] for i in range(len(limits))]
            least = tuple(least_hours([float(age[-1]) for age, _ in each]) for each in lives)
            passages = [
                [Passages.of(*life, hours) for life in each] for each, hours in zip(lives, least, strict=True)
            ]
            most = max(map(len, passages))
            if not any(life.precision.any() for of_limit in passages for life in of_limit):
                return None
            present = np.arange(most) < np.array([[len(one)] for one in passages])
            padded = [[*one, *[NO_LIFE] * (most - len(one))] for one in passages]
            fleet = Passages.stacked([Passages.stacked(one) for one in padded])
            return _FleetPopulation(sampled_population(fleet, stream(seed, "fellows' pace"), present), least)

        about = (self._keys, bounds, self.reference, self.exponents.tolist(), seed)
        return POPULATIONS.get(repr(about), computed)

    def _paths_of(self, unit: "Evidence", limits: "tuple[Limit, ...]") -> list[list[DegradationPath]]:
        """Return a unit's paths to each limit, one for each life of its component that has a diagnosis.

        A failure is assigned to the limit to which the unit was nearest, by extrapolated shares, of the
        components that were not diagnosed later in that life.
        """
        columns = [_columns(one)[0] for one in limits]
        lives = [unit.lives(column) for column in columns]
        paths = [
            [self._path(unit, one, *life) for life in each] for one, each in zip(limits, lives, strict=True)
        ]
        for failure in unit.failures:
            near = []
            for i, each in enumerate(lives):
                life = next(j for j, (_, until) in enumerate(each) if failure <= until)
                end = self._ageing_hours(unit, columns[i], each[life][0], failure)
                age, share = paths[i][life]
                if not age.size or age[-1] <= end:
                    near.append((_extrapolated_share(age, share, end), i, life, end))
            if near:
                _, i, life, end = max(near, key=lambda one: one[0])
                age, share = paths[i][life]
                paths[i][life] = np.append(age, end), np.append(share, share[-1:].max(initial=1.0))
        return [[path for path in each if path[0].size] for each in paths]

    def _path(self, unit: "Evidence", limit: "Limit", new_at: float, until: float) -> DegradationPath:
        """Return the path of a component from the flight hours `new_at`, when it was new, to `until` [h]."""
        column = _columns(limit)[0]
        seen = [one for one in unit.used if new_at < one.hours <= until and self._is_known(one, limit)]
        level = np.array([one.level for one in seen]).reshape(len(seen), len(CARTESIAN_NAMES))
        ages = np.array([self._ageing_hours(unit, column, new_at, one.hours) for one in seen])
        return ages, self._consumed_share(limit, level)

    def _consumed_share(self, limit: "Limit", level: Array) -> Array:
        """Return the consumed share of the margin at levels (n, 8), shape (n,)."""
        return np.asarray(1 - limit.margin(level_of(level, str(limit.component))) / self._full_margin(limit))

    def _full_margin(self, limit: "Limit") -> float:
        """Return the margin that a new unit has."""
        return float(limit.margin(level_of(self.new, str(limit.component))))

    def _ageing_hours(self, unit: "Evidence", column: int, new_at: float, hours: float) -> float:
        """Return the hours of ageing from the flight hours `new_at`, when a component was new, to `hours`."""
        return float(exposure(unit.stresses, self.reference, new_at, hours).aged(self.exponents[column]))

    def _ageing_rate(self, unit: "Evidence", column: int, hours: float, ahead: Stress | None) -> float:
        """Return the hours of ageing per flight hour to come: see `ageing_ahead`."""
        return float(ageing_ahead(unit.stresses, self.reference, hours, self.exponents[column], ahead))


def _columns(limit: "Limit") -> list[int]:
    return columns_of(str(limit.component))


def _extrapolated_share(age: Array, share: Array, end: float) -> float:
    """Return the consumed share at the age `end` [h], extrapolated by the last slope of the path."""
    ages, shares = np.concatenate([[0.0, 0.0], age])[-2:], np.concatenate([[0.0, 0.0], share])[-2:]
    hours = ages[1] - ages[0]
    slope = max((shares[1] - shares[0]) / hours, 0.0) if hours > 0 else 0.0
    return float(shares[1] + slope * (end - ages[1]))


def _survives_beyond_population(
    population: PopulationDraws, component: int, last: Passages, since: float, random: np.random.Generator
) -> bool:
    """Return whether a unit has worked for longer `since` its `last` diagnosis [h] than the population would.

    The drawn lives begin below the diagnosed share, by as much as a usable diagnosis may err.
    """
    if since <= 0:
        return False
    share = np.full(FLEET_PACE.survival_draws, last.share - FLEET_PACE.largest_error)
    left = remaining_hours(population, component, last, share, random)
    return bool(np.mean(left > since) < FLEET_PACE.least_survival)


def _ordered_by_limit(hours: Array) -> Array:
    """Return `hours` (k, n) of limits on one side of a level, the tightest first, as those of n paths.

    A path that passes one limit early passes all of them early, and none before a tighter one.
    """
    rank = hours[0].argsort().argsort()
    return np.asarray(np.maximum.accumulate(np.sort(hours, axis=1)[:, rank], axis=0))
