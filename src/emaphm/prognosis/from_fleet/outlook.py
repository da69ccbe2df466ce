"""When a unit fails by the pace of its fellows: pooled with the forecast of the filter."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array
from emaphm.memory import Memory
from emaphm.prognosis.columns import columns_of, level_of
from emaphm.prognosis.from_fleet.fingerprint import fingerprint
from emaphm.prognosis.from_fleet.pace import PopulationDraws, hours_left, learnt
from emaphm.prognosis.from_fleet.passages import Passages, least_hours
from emaphm.prognosis.stress import Stress, StressReference, ageing_ahead, exposure
from emaphm.random_streams import stream

if TYPE_CHECKING:
    from collections.abc import Sequence

    from emaphm.prognosis.belief import Belief
    from emaphm.prognosis.evidence import Evidence, Observation
    from emaphm.prognosis.requirements.failure_times import FailureTimes
    from emaphm.prognosis.requirements.margins import Limit

FEWEST_FELLOWS = 8
"""Units that teach a pace; it was measured with 26 and 30."""

FEWEST_GONE = 4
"""Lives of components that have gone a step, below which it is not known how long it takes: from fewer, the
steps that nobody has gone would be as long as the last one that somebody has."""

WEIGHT_OF_FILTER = 8.0
"""Fellows that the filter's forecast counts as: a fleet of 30 has not shown all that may happen. With 2, the
intervals of 90 % held the truth in 83 % late in life, of 109 synthetic units; with 8, in 86 %."""

LARGEST_ERROR = 0.05
"""Standard error of a level as a share of its way: with more, nothing says in which step it is."""

LARGEST_SURPRISE = 0.5
"""Probability that the last diagnosis of a level is an outlier or a jump: a pace takes it as stated."""

LEAST_WORKING = 0.05
"""Probability by the fellows' pace that a unit which works does so, below which their pace is not its own."""

DRAWN = 400
"""Lives by the fellows' pace of which that probability is taken: right to 1 %, one standard error."""

NOTHING = Passages.of(np.zeros(0), np.zeros(0))
"""In the place of a life that a component did not have, where others did."""


class _Learnt(NamedTuple):
    """What the fellows teach of the ways to some limits, and the least hours of a step of each [h]."""

    population: PopulationDraws
    least: tuple[float, ...]


LEARNT: Memory[_Learnt | None] = Memory(40)


@dataclass(frozen=True, eq=False)
class Fellows:
    """Units whose pace is learnt, by limits; `new` are levels of a new unit, (8,).

    Hours are those at the stress `reference`, with `exponents` (8, 3) for each component.
    """

    units: "Sequence[Evidence]"
    new: Array
    reference: StressReference | None
    exponents: Array

    def pooled(
        self,
        times: "FailureTimes",
        level: Array,
        belief: "Belief",
        evidence: "Evidence",
        ahead: Stress | None,
    ) -> "FailureTimes":
        """Return the failure times of a forecast, n / (n + 8) of its paths that work by the fellows' pace.

        n is the number of fellows. It stays as it is where a limit is on a measure or passed by a new unit,
        where they are fewer than 8 or none has shown any pace, where the last diagnosis knows a level worse
        than to 5 % of its way, where the unit has gone no tenth of any way, where it has worked for longer
        since its last diagnosis than 95 % of its fellows would, and where most paths have failed. The times
        of a limit stay where fewer than 4 lives have gone a step that is ahead on the way to it.

        Parameters
        ----------
        level
            Where the paths begin, (n, 8): by the belief, as the last diagnosis alone errs.
        belief
            That the forecast was made from: hours and seed are its.
        evidence
            Of the unit; what was diagnosed up to then counts.
        ahead
            The stress to come, as in `prognose`.
        """
        if len(self.units) < FEWEST_FELLOWS or np.median(times.first) == 0:
            return times
        if not all(self._is_usable(one, evidence, belief) for one in times.limits):
            return times
        # As the belief has it: a replacement at the hours of the last diagnosis came after that.
        born = [float(belief.born[_columns(one)[0]]) for one in times.limits]
        ways = [
            self._way(evidence, one, new_at, belief.hours)
            for one, new_at in zip(times.limits, born, strict=True)
        ]
        taught = self._taught(times.limits, belief.seed)
        if taught is None:
            return times
        population, least = taught
        gone = [Passages.of(*way, hours) for way, hours in zip(ways, least, strict=True)]
        if not any(one.passed for one in gone):
            return times
        random = stream(belief.seed, "fellows' pace", evidence.unit, belief.steps)
        share = len(self.units) / (len(self.units) + WEIGHT_OF_FILTER)
        working = np.flatnonzero(times.first > 0)
        chosen = random.permutation(working)[: round(share * working.size)]
        hours = times.hours.copy()
        for i, limit in enumerate(times.limits):
            if population.gone[i, int(gone[i].passed) :].min(initial=FEWEST_GONE) < FEWEST_GONE:
                continue
            column = _columns(limit)[0]
            age, now = ways[i][0], self._aged(evidence, column, born[i], belief.hours)
            since = now - age[-1] if age.size else 0.0
            if _has_outlived(population, i, gone[i], since, random):
                return times
            share_now = self._gone(limit, level[chosen])
            drawn = hours_left(population, i, gone[i].waiting(now, least[i]), share_now, random)
            hours[i, chosen] = drawn / self._pace(evidence, column, belief.hours, ahead)
        for side in times.sides:
            rows = np.array(side)[:, np.newaxis]
            hours[rows, chosen] = _as_of_one_path(hours[rows, chosen])
        return replace(times, hours=hours)

    @cached_property
    def _keys(self) -> list[str]:
        return [fingerprint(one) for one in self.units]

    def _is_usable(self, limit: "Limit", unit: "Evidence", belief: "Belief") -> bool:
        """Return whether a limit is on a level that a new unit holds, and that the last diagnosis knows."""
        if limit.component is None or self._whole(limit) <= 0:
            return False
        if belief.surprise[_columns(limit)].max() > LARGEST_SURPRISE:
            return False
        last = [one for one in unit.used if one.hours <= belief.hours][-1:]
        return all(self._is_known(one, limit) for one in last)

    def _is_known(self, one: "Observation", limit: "Limit") -> bool:
        """Return whether a diagnosis knows a level well enough to say in which step of its way it is."""
        columns = _columns(limit)
        error = np.sqrt(np.diag(one.covariance)[columns].max())
        return bool(one.seen[columns].all() and error <= LARGEST_ERROR * self._whole(limit))

    def _taught(self, limits: "tuple[Limit, ...]", seed: int) -> _Learnt | None:
        """Return what is learnt of the way to each of the `limits`; None where no unit has shown any pace."""
        bounds = [(one.component, one.bound, one.upper) for one in limits]

        def computed() -> _Learnt | None:
            ways = [self._ways_of(one, limits) for one in self.units]
            lives = [[life for of_unit in ways for life in of_unit[i]] for i in range(len(limits))]
            least = tuple(least_hours([float(age[-1]) for age, _ in each]) for each in lives)
            shown = [
                [Passages.of(*life, hours) for life in each] for each, hours in zip(lives, least, strict=True)
            ]
            most = max(map(len, shown))
            if not any(life.precision.any() for of_limit in shown for life in of_limit):
                return None
            there = np.arange(most) < np.array([[len(one)] for one in shown])
            padded = [[*one, *[NOTHING] * (most - len(one))] for one in shown]
            fleet = Passages.stacked([Passages.stacked(one) for one in padded])
            return _Learnt(learnt(fleet, stream(seed, "fellows' pace"), there), least)

        about = (self._keys, bounds, self.reference, self.exponents.tolist(), seed)
        return LEARNT.get(repr(about), computed)

    def _ways_of(self, unit: "Evidence", limits: "tuple[Limit, ...]") -> list[list[tuple[Array, Array]]]:
        """Return a unit's ways to each limit, one for each life of its component that a diagnosis has seen.

        A failure is that of the limit which it came nearest to, among components that worked no longer then.
        """
        columns = [_columns(one)[0] for one in limits]
        lives = [unit.lives(column) for column in columns]
        ways = [
            [self._way(unit, one, *life) for life in each] for one, each in zip(limits, lives, strict=True)
        ]
        for failure in unit.failures:
            near = []
            for i, each in enumerate(lives):
                life = next(j for j, (_, until) in enumerate(each) if failure <= until)
                end = self._aged(unit, columns[i], each[life][0], failure)
                age, way = ways[i][life]
                if not age.size or age[-1] <= end:
                    near.append((_ahead(age, way, end), i, life, end))
            if near:
                _, i, life, end = max(near, key=lambda one: one[0])
                age, way = ways[i][life]
                ways[i][life] = np.append(age, end), np.append(way, way[-1:].max(initial=1.0))
        return [[way for way in each if way[0].size] for each in ways]

    def _way(self, unit: "Evidence", limit: "Limit", born: float, until: float) -> tuple[Array, Array]:
        """Return ages (n,) [h] at which a component `born` then was seen, and shares of its way (n,)."""
        column = _columns(limit)[0]
        seen = [one for one in unit.used if born < one.hours <= until and self._is_known(one, limit)]
        level = np.array([one.level for one in seen]).reshape(len(seen), len(CARTESIAN_NAMES))
        ages = np.array([self._aged(unit, column, born, one.hours) for one in seen])
        return ages, self._gone(limit, level)

    def _gone(self, limit: "Limit", level: Array) -> Array:
        """Return the share of the way that is gone at levels (n, 8), shape (n,)."""
        return np.asarray(1 - limit.margin(level_of(level, str(limit.component))) / self._whole(limit))

    def _whole(self, limit: "Limit") -> float:
        """Return the whole way: the margin that a new unit has."""
        return float(limit.margin(level_of(self.new, str(limit.component))))

    def _aged(self, unit: "Evidence", column: int, born: float, hours: float) -> float:
        """Return how far a component has aged from flight hours `born`, when it was new, to `hours` [h]."""
        return float(exposure(unit.stresses, self.reference, born, hours).aged(self.exponents[column]))

    def _pace(self, unit: "Evidence", column: int, hours: float, ahead: Stress | None) -> float:
        """Return the hours of ageing in an hour to come: see `ageing_ahead`."""
        return float(ageing_ahead(unit.stresses, self.reference, hours, self.exponents[column], ahead))


def _columns(limit: "Limit") -> list[int]:
    return columns_of(str(limit.component))


def _ahead(age: Array, way: Array, end: float) -> float:
    """Return the share of its way at which a component is at the age `end` [h], by its last slope."""
    ages, ways = np.concatenate([[0.0, 0.0], age])[-2:], np.concatenate([[0.0, 0.0], way])[-2:]
    hours = ages[1] - ages[0]
    slope = max((ways[1] - ways[0]) / hours, 0.0) if hours > 0 else 0.0
    return float(ways[1] + slope * (end - ages[1]))


def _has_outlived(
    population: PopulationDraws, component: int, last: Passages, since: float, random: np.random.Generator
) -> bool:
    """Return whether what works `since` its `last` diagnosis [h] has outlived the pace of its fellows.

    From as far back on its way as a diagnosis that teaches may err.
    """
    if since <= 0:
        return False
    left = hours_left(population, component, last, np.full(DRAWN, last.share - LARGEST_ERROR), random)
    return bool(np.mean(left > since) < LEAST_WORKING)


def _as_of_one_path(hours: Array) -> Array:
    """Return `hours` (k, n) of limits on one side of a level, the tightest first, as of n paths.

    What passes one limit early passes all of them early, and none before a tighter one.
    """
    rank = hours[0].argsort().argsort()
    return np.asarray(np.maximum.accumulate(np.sort(hours, axis=1)[:, rank], axis=0))
