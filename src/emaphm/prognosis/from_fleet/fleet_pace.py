"""The pace of a fleet's units towards their limits: their paths, and the population that these show."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array
from emaphm.memory import Memory
from emaphm.prognosis.columns import columns_of, level_of
from emaphm.prognosis.evidence import Evidence, Observation
from emaphm.prognosis.from_fleet.fingerprint import fingerprint
from emaphm.prognosis.from_fleet.pace_population import PopulationDraws, sampled_population
from emaphm.prognosis.from_fleet.passages import Passages, least_hours
from emaphm.prognosis.requirements.margins import Limit
from emaphm.prognosis.stress import Stress, StressReference, ageing_ahead, exposure
from emaphm.random_streams import stream


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


class FleetPopulation(NamedTuple):
    """The population of paces to some limits, and the least hours of a step to each limit [h]."""

    population: PopulationDraws
    least: tuple[float, ...]


POPULATIONS: Memory[FleetPopulation | None] = Memory(40)


@dataclass(frozen=True, eq=False)
class FleetPaceModel:
    """Pace of `units` towards limits, from their diagnoses; `new` is the level of a new unit, (8,).

    The consumed share of a margin is 0 at the level of a new unit and 1 at the limit. Hours are those at the
    stress `reference`, with `exponents` (8, 3) for each component.
    """

    units: Sequence[Evidence]
    new: Array
    reference: StressReference | None
    exponents: Array

    @cached_property
    def shown_share(self) -> float:
        """How far the pace is that of all units: as long as some work, the last steps are those of the fast.

        √f, f being the share of the units that have failed. Of 200 made-up units with many laws and lives of
        500 to 8,000 h, 30 of 100 failed, the 90 % intervals of 50 held 37 times without it, 46 times with it;
        of 168 units of alike fleets, 159 and 163 times.
        """
        return float(np.sqrt(np.mean([bool(one.failures) for one in self.units])))

    @cached_property
    def _keys(self) -> list[str]:
        return [fingerprint(one) for one in self.units]

    def is_known(self, diagnosis: Observation, limit: Limit) -> bool:
        """Return whether a diagnosis knows a level well enough to say which step the component is in."""
        columns = columns_of_limit(limit)
        error = np.sqrt(np.diag(diagnosis.covariance)[columns].max())
        return bool(
            diagnosis.seen[columns].all() and error <= FLEET_PACE.largest_error * self.full_margin(limit)
        )

    def population(self, limits: tuple[Limit, ...], seed: int) -> FleetPopulation | None:
        """Return the population of paces to each of the `limits`; None if no unit has shown any pace."""
        bounds = [(one.component, one.bound, one.upper) for one in limits]

        def computed() -> FleetPopulation | None:
            paths = [self.paths_of(one, limits) for one in self.units]
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
            return FleetPopulation(sampled_population(fleet, stream(seed, "fellows' pace"), present), least)

        about = (self._keys, bounds, self.reference, self.exponents.tolist(), seed)
        return POPULATIONS.get(repr(about), computed)

    def paths_of(self, unit: Evidence, limits: tuple[Limit, ...]) -> list[list[DegradationPath]]:
        """Return a unit's paths to each limit, one for each life of its component that has a diagnosis.

        A failure is assigned to the limit to which the unit was nearest, by extrapolated shares, of the
        components that were not diagnosed later in that life.
        """
        columns = [columns_of_limit(one)[0] for one in limits]
        lives = [unit.lives(column) for column in columns]
        paths = [
            [self.path(unit, one, *life) for life in each] for one, each in zip(limits, lives, strict=True)
        ]
        for failure in unit.failures:
            near = []
            for i, each in enumerate(lives):
                life = next(j for j, (_, until) in enumerate(each) if failure <= until)
                end = self.ageing_hours(unit, columns[i], each[life][0], failure)
                age, share = paths[i][life]
                if not age.size or age[-1] <= end:
                    near.append((_extrapolated_share(age, share, end), i, life, end))
            if near:
                _, i, life, end = max(near, key=lambda one: one[0])
                age, share = paths[i][life]
                paths[i][life] = np.append(age, end), np.append(share, share[-1:].max(initial=1.0))
        return [[path for path in each if path[0].size] for each in paths]

    def path(self, unit: Evidence, limit: Limit, new_at: float, until: float) -> DegradationPath:
        """Return the path of a component from the flight hours `new_at`, when it was new, to `until` [h]."""
        column = columns_of_limit(limit)[0]
        seen = [one for one in unit.used if new_at < one.hours <= until and self.is_known(one, limit)]
        level = np.array([one.level for one in seen]).reshape(len(seen), len(CARTESIAN_NAMES))
        ages = np.array([self.ageing_hours(unit, column, new_at, one.hours) for one in seen])
        return ages, self.consumed_share(limit, level)

    def consumed_share(self, limit: Limit, level: Array) -> Array:
        """Return the consumed share of the margin at levels (n, 8), shape (n,)."""
        return np.asarray(1 - limit.margin(level_of(level, str(limit.component))) / self.full_margin(limit))

    def full_margin(self, limit: Limit) -> float:
        """Return the margin that a new unit has."""
        return float(limit.margin(level_of(self.new, str(limit.component))))

    def ageing_hours(self, unit: Evidence, column: int, new_at: float, hours: float) -> float:
        """Return the hours of ageing from the flight hours `new_at`, when a component was new, to `hours`."""
        return float(exposure(unit.stresses, self.reference, new_at, hours).aged(self.exponents[column]))

    def ageing_rate(self, unit: Evidence, column: int, hours: float, ahead: Stress | None) -> float:
        """Return the hours of ageing per flight hour to come: see `ageing_ahead`."""
        return float(ageing_ahead(unit.stresses, self.reference, hours, self.exponents[column], ahead))


def columns_of_limit(limit: Limit) -> list[int]:
    """Return the columns of the levels that a limit is on."""
    return columns_of(str(limit.component))


def _extrapolated_share(age: Array, share: Array, end: float) -> float:
    """Return the consumed share at the age `end` [h], extrapolated by the last slope of the path."""
    ages, shares = np.concatenate([[0.0, 0.0], age])[-2:], np.concatenate([[0.0, 0.0], share])[-2:]
    hours = ages[1] - ages[0]
    slope = max((shares[1] - shares[0]) / hours, 0.0) if hours > 0 else 0.0
    return float(shares[1] + slope * (end - ages[1]))
