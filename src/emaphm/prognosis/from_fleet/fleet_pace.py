"""Pace of a fleet's units towards their limits: their paths, and the population estimated from them."""

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
from emaphm.prognosis.from_fleet.missions import UNKNOWN, FutureStress, Missions
from emaphm.prognosis.from_fleet.pace_population import PopulationDraws, sampled_population
from emaphm.prognosis.from_fleet.passages import Passages, least_hours
from emaphm.prognosis.requirements.margins import Limit
from emaphm.prognosis.stress import Stress, StressReference, exposure
from emaphm.random_streams import stream


@dataclass(frozen=True)
class FleetPaceSettings:
    """Conditions for the use of the pace of other units in a forecast, and its weight relative to the filter.

    The pace is used with at least `fewest_units` units; it was measured with 26 and 30. The failure times of
    a limit use the pace if at least `fewest_passed` lives have passed each step that is ahead: a step that no
    unit has passed would be assumed as long as the last step that a unit has passed.

    The filter's forecast has the weight of `filter_weight` units, because 30 units do not cover all courses
    of degradation. With 2, the 90 % intervals contained the true RUL in 83 % of the cases late in life, of
    109 synthetic units; with 8, in 86 % (`python -m emaphm.study.fleet FOLDER` makes such units).

    A diagnosis whose standard error is above `largest_error` of the full margin does not determine the step
    of a component. A diagnosis that is an outlier or a jump with a probability above `largest_surprise` is
    not used, because the pace takes diagnoses as stated.

    The pace is not used for a unit whose survival since its last diagnosis has a probability below
    `least_survival` in the population, computed from `survival_draws` lives with a standard error of 1 %.
    """

    fewest_units: int = 8
    fewest_passed: int = 4
    filter_weight: float = 8.0
    largest_error: float = 0.05
    largest_surprise: float = 0.5
    least_survival: float = 0.05
    survival_draws: int = 400


FLEET_PACE = FleetPaceSettings()

DegradationPath = tuple[Array, Array]
"""Ages (n,) [h] of a component at its diagnoses, and the consumed shares of its margin (n,) [-]."""


class FleetPopulation(NamedTuple):
    """Population of paces towards some limits, and the least hours of a step for each limit [h]."""

    population: PopulationDraws
    least: tuple[float, ...]


POPULATIONS: Memory[FleetPopulation | None] = Memory(40)


@dataclass(frozen=True, eq=False)
class FleetPaceModel:
    """Pace of `units` towards limits, from their diagnoses; `new` is the level of a new unit, (8,).

    The consumed share of a margin is 0 at the level of a new unit and 1 at the limit. Hours are those at the
    stress `reference`, with `exponents` (8, 3) for each component; `missions` is as in `Prior`.
    """

    units: Sequence[Evidence]
    new: Array
    reference: StressReference | None
    exponents: Array
    missions: Missions = UNKNOWN

    @cached_property
    def shown_share(self) -> float:
        """Weight √f of the pace, where f is the share of failed units.

        While some units still work, only the fast units have passed the last steps. Of 200 synthetic units
        with many laws and lives of 500 to 8,000 h, 30 of 100 had failed; of 50 90 % intervals, 37 contained
        the true value without this weight, and 46 with it; of 168 units of homogeneous fleets, 159 and 163.
        """
        return float(np.sqrt(np.mean([bool(unit.failures) for unit in self.units])))

    @cached_property
    def _keys(self) -> list[str]:
        return [fingerprint(unit) for unit in self.units]

    def is_known(self, diagnosis: Observation, limit: Limit) -> bool:
        """Return whether a diagnosis is accurate enough to determine the step of the limited component."""
        columns = columns_of_limit(limit)
        error = np.sqrt(np.diag(diagnosis.covariance)[columns].max())
        return bool(
            diagnosis.seen[columns].all() and error <= FLEET_PACE.largest_error * self.full_margin(limit)
        )

    def population(self, limits: tuple[Limit, ...], seed: int) -> FleetPopulation | None:
        """Return the population of paces towards each of the `limits`; None without any known step."""
        bounds = [(limit.component, limit.bound, limit.upper) for limit in limits]

        def computed() -> FleetPopulation | None:
            paths = [self.paths_of(unit, limits) for unit in self.units]
            lives = [[life for of_unit in paths for life in of_unit[i]] for i in range(len(limits))]
            least = tuple(least_hours([float(age[-1]) for age, _ in of_limit]) for of_limit in lives)
            passages = [
                [Passages.of(*life, hours) for life in of_limit]
                for of_limit, hours in zip(lives, least, strict=True)
            ]
            most = max(map(len, passages))
            if not any(life.precision.any() for of_limit in passages for life in of_limit):
                return None
            present = np.arange(most) < np.array([[len(of_limit)] for of_limit in passages])
            # Placeholder for a life that a component did not have, if another component had more lives.
            no_life = Passages.of(np.zeros(0), np.zeros(0))
            padded = [[*of_limit, *[no_life] * (most - len(of_limit))] for of_limit in passages]
            fleet = Passages.stacked([Passages.stacked(of_limit) for of_limit in padded])
            return FleetPopulation(sampled_population(fleet, stream(seed, "fellows' pace"), present), least)

        about = (self._keys, bounds, self.reference, self.exponents.tolist(), seed)
        return POPULATIONS.get(repr(about), computed)

    def paths_of(self, unit: Evidence, limits: tuple[Limit, ...]) -> list[list[DegradationPath]]:
        """Return a unit's paths towards each limit, one for each life of the component with a diagnosis.

        A failure is assigned to the limit to which the unit was nearest according to extrapolated shares,
        among the components that were not diagnosed later in that life.
        """
        columns = [columns_of_limit(limit)[0] for limit in limits]
        lives = [unit.lives(column) for column in columns]
        paths = [
            [self.path(unit, limit, *life) for life in of_limit]
            for limit, of_limit in zip(limits, lives, strict=True)
        ]
        for failure in unit.failures:
            near = []
            for i, of_limit in enumerate(lives):
                life = next(j for j, (_, until) in enumerate(of_limit) if failure <= until)
                end = self.ageing_hours(unit, columns[i], of_limit[life][0], failure)
                age, share = paths[i][life]
                if not age.size or age[-1] <= end:
                    near.append((_extrapolated_share(age, share, end), i, life, end))
            if near:
                _, i, life, end = max(near, key=lambda candidate: candidate[0])
                age, share = paths[i][life]
                paths[i][life] = np.append(age, end), np.append(share, share[-1:].max(initial=1.0))
        return [[path for path in of_limit if path[0].size] for of_limit in paths]

    def path(self, unit: Evidence, limit: Limit, new_at: float, until: float) -> DegradationPath:
        """Return the path of a component from `new_at`, when it was new, to `until` (flight hours [h])."""
        column = columns_of_limit(limit)[0]
        diagnoses = [
            diagnosis
            for diagnosis in unit.used
            if new_at < diagnosis.hours <= until and self.is_known(diagnosis, limit)
        ]
        level = np.array([diagnosis.level for diagnosis in diagnoses]).reshape(
            len(diagnoses), len(CARTESIAN_NAMES)
        )
        ages = np.array([self.ageing_hours(unit, column, new_at, diagnosis.hours) for diagnosis in diagnoses])
        return ages, self.consumed_share(limit, level)

    def consumed_share(self, limit: Limit, level: Array) -> Array:
        """Return the consumed share of the margin at levels (n, 8), shape (n,)."""
        return np.asarray(1 - limit.margin(level_of(level, str(limit.component))) / self.full_margin(limit))

    def full_margin(self, limit: Limit) -> float:
        """Return the margin of a new unit."""
        return float(limit.margin(level_of(self.new, str(limit.component))))

    def ageing_hours(self, unit: Evidence, column: int, new_at: float, hours: float) -> float:
        """Return the hours of ageing [h] from `new_at`, when the component was new, to flight `hours`."""
        return float(exposure(unit.stresses, self.reference, new_at, hours).aged(self.exponents[column]))

    def stress_ahead(
        self, unit: Evidence, hours: float, ahead: Stress | None, count: int, random: np.random.Generator
    ) -> FutureStress:
        """Return `count` draws of a unit's stress after flight `hours` [h]: see `FutureStress.drawn`."""
        return FutureStress.drawn(self.missions, unit.stresses, self.reference, hours, ahead, count, random)


def columns_of_limit(limit: Limit) -> list[int]:
    """Return the columns of the limited component's level."""
    return columns_of(str(limit.component))


def _extrapolated_share(age: Array, share: Array, end: float) -> float:
    """Return the consumed share at the age `end` [h], extrapolated by the last slope of the path."""
    ages, shares = np.concatenate([[0.0, 0.0], age])[-2:], np.concatenate([[0.0, 0.0], share])[-2:]
    hours = ages[1] - ages[0]
    slope = max((shares[1] - shares[0]) / hours, 0.0) if hours > 0 else 0.0
    return float(shares[1] + slope * (end - ages[1]))
