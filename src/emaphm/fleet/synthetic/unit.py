"""A synthetic unit: its wearing components, its stress, and its true levels over the flight hours."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from emaphm.actuator.faults import HEALTHY, NAMES
from emaphm.arrays import Array
from emaphm.fleet.synthetic.growth import LAWS
from emaphm.fleet.synthetic.plan import FleetPlan
from emaphm.fleet.synthetic.population import Population, StressModel, Wear
from emaphm.prognosis.stress import Stress
from emaphm.random_streams import stream

STEPS = 16
"""Steps of the true levels between two check flights: 5 h each for 80 h."""

FALLING = ("gain",)
"""Components whose fault is a decrease below healthy."""


@dataclass(frozen=True)
class Component:
    """A wearing component: its law with parameters, its life under nominal stress [h], and its limit."""

    name: str
    law: str
    parameters: dict[str, float]
    life: float
    limit: float

    def level(self, healthy: float, progress: Array) -> Array:
        """Return the level (m,) at `progress` (m,) from `healthy`, within [0, 1], or [-1, 1] for friction."""
        sign = -1.0 if self.name in FALLING else 1.0
        lowest = -1.0 if self.name == "friction" else 0.0
        return np.asarray(np.clip(healthy + sign * self.limit * progress, lowest, 1.0))

    def failed(self, level: Array) -> Array:
        """Return whether the `level`, any shape, is beyond the limit."""
        nominal = getattr(HEALTHY, self.name)
        return np.asarray(
            level <= nominal - self.limit if self.name in FALLING else level >= nominal + self.limit
        )


@dataclass(frozen=True, eq=False)
class SyntheticUnit:
    """A unit up to its failure, or to its last check flight.

    Attributes
    ----------
    serial_number
        Begins with "SYNTHETIC".
    components
        The wearing components.
    new
        Fault vector of the new unit, (8,), in the order of `Faults`.
    mission
        ΔT [K] and l of the unit's mission (`StressModel`).
    stress
        ΔT [K] and l of each interval between two check flights of the plan, (2, intervals).
    hours, ageing
        Flight hours [h] and hours of ageing, (m,) each, the first 0.
    vectors
        True fault vectors at these hours, (m, 8).
    failure, failed
        Flight hours of the failure [h], and the component that fails; None if the unit still works.
    """

    serial_number: str
    components: tuple[Component, ...]
    new: Array
    mission: tuple[float, float]
    stress: Array
    hours: Array
    ageing: Array
    vectors: Array
    failure: float | None
    failed: str | None

    def row(self, hours: float) -> int:
        """Return the row of the true levels at flight `hours` [h]."""
        return int(np.searchsorted(self.hours, hours - 1e-9))

    def check_flights(self, interval: float) -> Array:
        """Return the hours [h] of the check flights, before the failure, (n,)."""
        count = int(self.hours[-1] / interval + 1e-9)
        flights = interval * np.arange(1, count + 1)
        if self.failure is None:
            return np.asarray(flights)
        return np.asarray(flights[flights < self.failure - 1e-9 * interval])

    def recorded_stress(self, number: int, model: StressModel) -> Stress:
        """Return the mean stress before check flight `number`, from 1, as an operator records it."""
        return model.recorded(*self.stress[:, number - 1])

    def to_dict(self) -> dict[str, Any]:
        """Return the true values except the levels, ready for `json.dumps`."""
        return {
            "unit": self.serial_number,
            "synthetic": True,
            "failure_hours": self.failure,
            "failed": self.failed,
            "mission_K": self.mission[0],
            "mission_load": self.mission[1],
            "components": [
                {"component": one.name, "law": one.law, "life_hours": one.life, "limit": one.limit}
                | {"parameters": one.parameters}
                for one in self.components
            ],
        }


def serial_number(number: int) -> str:
    """Return the serial number of a synthetic unit."""
    return f"SYNTHETIC-{number:04d}"


def drawn_unit(plan: FleetPlan, number: int) -> SyntheticUnit:
    """Return unit `number`, from 0, of a synthetic fleet; it does not depend on the fleet's size."""
    population = plan.drawn_from
    random = stream(plan.seed, "synthetic unit", population.name, number)
    new = HEALTHY.vector.copy()
    new[[0, 1, 2, 3, 4, 5, 7]] += population.new_level * random.standard_normal(7)
    new[1:6] = np.abs(new[1:6])
    new[NAMES.index("eccentricity_phase")] = random.random()
    components = tuple(
        component
        for name, wear in population.wear.items()
        if (component := _drawn_component(name, wear, random)) is not None
    )
    stress = population.stress
    mission = (stress.mission_K * random.standard_normal(), stress.mission_load * random.standard_normal())
    hours = np.linspace(0.0, plan.flights * plan.interval, plan.flights * STEPS + 1)
    of_intervals = stress.drawn(mission, plan.flights + 1, random)
    ageing = aged(hours, of_intervals, stress, plan.interval)
    vectors = np.tile(new, (hours.size, 1))
    ends = np.full(len(components), hours.size)
    for i, one in enumerate(components):
        column = NAMES.index(one.name)
        vectors[:, column] = one.level(new[column], progress(one, ageing, population, random))
        beyond = np.flatnonzero(one.failed(vectors[:, column]))
        ends[i] = beyond[0] if beyond.size else hours.size
    end = int(ends.min(initial=hours.size))
    has_failed = end < hours.size
    upto = slice(0, end + 1)
    return SyntheticUnit(
        serial_number=serial_number(number),
        components=components,
        new=new,
        mission=mission,
        stress=of_intervals,
        hours=hours[upto],
        ageing=ageing[upto],
        vectors=vectors[upto],
        failure=float(hours[end]) if has_failed else None,
        failed=components[int(ends.argmin())].name if has_failed else None,
    )


def aged(hours: Array, of_intervals: Array, stress: StressModel, interval: float) -> Array:
    """Return the hours of ageing (m,) at increasing flight `hours` (m,).

    `of_intervals` are ΔT [K] and l of each `interval` [h] from the first of the hours on, (2, intervals).
    """
    steps = np.diff(hours, prepend=hours[0])
    at = ((hours - hours[0] - steps / 2) / interval).astype(int)
    rates = stress.ageing(*of_intervals)
    return np.cumsum(steps * rates[np.minimum(at, rates.size - 1)])


def progress(one: Component, ageing: Array, population: Population, random: np.random.Generator) -> Array:
    """Return the progress (m,) of a component at increasing `ageing` [h], (m,), drift included."""
    u = ageing / one.life
    drift = population.drift / one.limit * np.sqrt(np.diff(u, prepend=u[0]))
    return LAWS[one.law].progress(u, one.parameters, random) + np.cumsum(
        drift * random.standard_normal(u.size)
    )


def _drawn_component(name: str, wear: Wear, random: np.random.Generator) -> Component | None:
    # The same random numbers are drawn if it does not wear: another share does not change other draws.
    wears, law = random.random() < wear.share, str(random.choice(list(wear.laws), p=list(wear.laws.values())))
    life = wear.life * float(np.exp(wear.spread * random.standard_normal()))
    parameters = LAWS[law].drawn(random)
    return Component(name, law, parameters, life, wear.limit) if wears else None
