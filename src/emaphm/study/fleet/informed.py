"""Remaining useful life by Bayes' rule from the true population: the best prediction for an unknown unit.

The prior is the true population of the fleet (`population.py`, `growth.py`): the laws with their shares and
ranges of parameters and lives, the drift, and how stress determines ageing. The unit's own values are
unknown; only its diagnoses and its recorded stress are used. No method that learns from a fleet can have more
information on a new unit.

Given the law of each component of the unit and diagnoses without error, the prediction is clairvoyant on law
and true level, but not on the parameters of the law, the rate and the mission.

Each component has `SAMPLE` draws of law, parameters and life, weighted by the likelihood of its diagnoses. In
each draw, the level is estimated by a Kalman filter; the recorded stress determines the hours of ageing.
Given these, the components are independent. The stress of future intervals is drawn: its mean over a mission
from the posterior distribution given the recorded intervals.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array
from emaphm.fleet.synthetic import FleetPlan
from emaphm.fleet.synthetic.growth import LAWS
from emaphm.fleet.synthetic.population import Population, StressModel, Wear
from emaphm.fleet.synthetic.unit import FALLING
from emaphm.prognosis import Evidence, Observation
from emaphm.prognosis.columns import columns_of, level_of
from emaphm.prognosis.filter.following import LEAST_ERROR
from emaphm.prognosis.stress import recorded_within
from emaphm.random_streams import stream

Rows = NDArray[np.int_]

SAMPLE = 100_000
"""Draws per component: late in life, some hundred of them carry the weight, even with a known level."""

PATHS = 1000
"""Number of predicted paths."""

STEP = 50.0
"""Time step of the predicted paths [h]."""

LONGEST_LIFE = 12_000.0
"""Longest predicted life [h]."""

NEVER = "none"
"""Name of the law of a component that does not wear."""

CHANCE = "gamma process"
"""The law with random increments: the filter uses their mean and variance, predictions draw them."""


class Component:
    """One component of a unit: `SAMPLE` draws of law, parameters and life, with the level in each.

    The age of the component is in hours of ageing [h]. If a `law` is given, all draws have this law.
    """

    def __init__(
        self, name: str, wear: Wear, plan: FleetPlan, random: np.random.Generator, law: str | None = None
    ) -> None:
        self.name, self.wear, self.plan = name, wear, plan
        population = plan.drawn_from
        self.laws = (*wear.laws, NEVER)
        shares = [*(wear.share * share for share in wear.laws.values()), 1 - wear.share]
        if law is not None:
            shares = [float(name == law) for name in self.laws]
        self.law = random.choice(len(self.laws), size=SAMPLE, p=shares)
        self.life = wear.life * np.exp(wear.spread * random.standard_normal(SAMPLE))
        self.parameters = {
            law: {key: random.uniform(*ends, SAMPLE) for key, ends in LAWS[law].ranges.items()}
            for law in wear.laws
        }
        self.level = np.zeros(SAMPLE)
        self.variance = np.full(SAMPLE, population.new_level**2)
        self.log_weight = np.zeros(SAMPLE)
        self.age = 0.0

    def moved(self, age: Array, rows: Rows) -> Array:
        """Return the change of the level of the draws `rows` (n,) at their `age` [h] (n,), shape (n,)."""
        result = np.zeros(age.size)
        for i, law in enumerate(self.laws[:-1]):
            of_law = self.law[rows] == i
            chosen = rows[of_law]
            u = age[of_law] / self.life[chosen]
            if law == CHANCE:
                result[of_law] = u
            elif u.size:
                parameters = {key: values[chosen] for key, values in self.parameters[law].items()}
                result[of_law] = LAWS[law].progress(u, parameters, None)  # type: ignore[arg-type]
        return np.asarray(result * self.wear.limit)

    def update(self, diagnosis: Observation, aged: float) -> None:
        """Update levels and weights of the draws with a diagnosis, `aged` [h] of ageing after the last."""
        level, error = _observed(diagnosis, self.name)
        rows = np.arange(SAMPLE)
        before, after = (self.moved(np.full(SAMPLE, age), rows) for age in (self.age, self.age + aged))
        predicted = self.level + after - before
        variance = self.variance + self._noise(aged, rows)
        total = variance + error + LEAST_ERROR**2
        innovation = level - predicted
        self.log_weight -= 0.5 * (innovation**2 / total + np.log(total))
        self.level = predicted + variance / total * innovation
        self.variance = variance * (1 - variance / total)
        self.age += aged

    def drawn(self, random: np.random.Generator) -> tuple[Rows, Array]:
        """Return `PATHS` rows of the draws, sampled by weight, with their levels, (n,) each."""
        weight = np.exp(self.log_weight - self.log_weight.max())
        rows = random.choice(SAMPLE, PATHS, p=weight / weight.sum())
        deviation = np.sqrt(np.maximum(self.variance[rows], 0.0))
        return rows, self.level[rows] + deviation * random.standard_normal(PATHS)

    def step(self, age: Array, aged: Array, rows: Rows, random: np.random.Generator) -> Array:
        """Return the change of the levels of components of `age` that age by `aged`, both (n,) [h]."""
        change = self.moved(age + aged, rows) - self.moved(age, rows)
        if CHANCE in self.laws:
            jumps = self.parameters[CHANCE]["jumps"][rows]
            drawn = self.wear.limit * random.gamma(jumps * aged / self.life[rows]) / jumps
            change = np.where(self.law[rows] == self.laws.index(CHANCE), drawn, change)
        drift = self.plan.drawn_from.drift * np.sqrt(aged / self.life[rows])
        wears = self.law[rows] < len(self.laws) - 1
        return np.asarray(change + np.where(wears, drift * random.standard_normal(rows.size), 0.0))

    def _noise(self, aged: float, rows: Rows) -> Array:
        """Return the variance that drift and jumps add to the levels within `aged` [h] of ageing, (n,)."""
        lives = aged / self.life[rows]
        variance = np.where(self.law[rows] < len(self.laws) - 1, self.plan.drawn_from.drift**2 * lives, 0.0)
        if CHANCE in self.laws:
            jumps = self.wear.limit**2 * lives / self.parameters[CHANCE]["jumps"][rows]
            variance = variance + np.where(self.law[rows] == self.laws.index(CHANCE), jumps, 0.0)
        return np.asarray(variance)


def informed(
    evidence: Evidence, plan: FleetPlan, at: Sequence[int], laws: Mapping[str, str] | None = None
) -> list[Array]:
    """Return samples of the RUL [h], (`PATHS`,), after the explained diagnoses numbered `at`, increasing.

    `laws` are the laws of the components that wear; the others are then known not to wear. By default, all
    laws are unknown.
    """
    random = stream(plan.seed, "informed", evidence.unit)
    population: Population = plan.drawn_from
    components = [
        Component(name, wear, plan, random, None if laws is None else laws.get(name, NEVER))
        for name, wear in population.wear.items()
    ]
    hours = [0.0, *(diagnosis.hours for diagnosis in evidence.used)]
    samples = []
    for i, diagnosis in enumerate(evidence.used[: max(at) + 1]):
        stress = recorded_stretches(evidence, population.stress, hours[i], hours[i + 1])
        for component in components:
            component.update(diagnosis, stress.aged(population.stress))
        if i in at:
            flown = recorded_stretches(evidence, population.stress, 0.0, hours[i + 1])
            sample = _lives(components, plan, rates_ahead(flown, plan, random), random)
            samples += [sample] * list(at).count(i)
    return samples


def _lives(components: list[Component], plan: FleetPlan, ahead: Array, random: np.random.Generator) -> Array:
    """Return a sample of the RUL of a unit [h], (`PATHS`,), from the draws of its components.

    `ahead` is the ageing rate [-] of each future interval between two check flights, (intervals, `PATHS`).
    """
    life = np.full(PATHS, np.inf)
    states = [component.drawn(random) for component in components]
    for component, (_, level) in zip(components, states, strict=True):
        life[level >= component.wear.limit] = 0.0
    flown = np.zeros(PATHS)
    for hours in np.arange(0.0, LONGEST_LIFE, STEP):
        if np.isfinite(life).all():
            break
        aged = STEP * ahead[int(hours / plan.interval)]
        after = []
        for component, (rows, level) in zip(components, states, strict=True):
            change = component.step(component.age + flown, aged, rows, random)
            with np.errstate(divide="ignore", invalid="ignore"):
                passed = hours + STEP * (component.wear.limit - level) / change
            crosses = (level < component.wear.limit) & (level + change >= component.wear.limit)
            life = np.where(crosses, np.minimum(life, passed), life)
            after.append((rows, level + change))
        states, flown = after, flown + aged
    return life


class Flown(NamedTuple):
    """Recorded stretches of flight: `hours` (n,) [h], and `values` (2, n): ΔT [K] and l."""

    hours: Array
    values: Array

    def aged(self, model: StressModel) -> float:
        """Return the hours of ageing [h]."""
        return float(model.ageing(*self.values) @ self.hours)


def recorded_stretches(evidence: Evidence, model: StressModel, start: float, end: float) -> Flown:
    """Return the recorded stretches from `start` to `end` [h]."""
    hours, values = [], []
    for recorded, stress in recorded_within(evidence.stresses, start, end):
        hours.append(recorded)
        values.append(model.deviations(stress))
    return Flown(np.array(hours), np.array(values, float).reshape(-1, 2).T)


def rates_ahead(flown: Flown, plan: FleetPlan, random: np.random.Generator) -> Array:
    """Return ageing rates [-] of future intervals, (intervals, `PATHS`), given the recorded stretches.

    ΔT and l of a mission are normal about 0, those of an interval about the mission's: the posterior
    distribution of the mission given n intervals with mean x is normal with variance 1 / (1/σ_m² + n/σ_f²),
    and mean x n/σ_f² times this variance.
    """
    model = plan.drawn_from.stress
    count = int(np.ceil(LONGEST_LIFE / plan.interval))
    ahead = []
    for recorded, of_mission, of_flight in (
        (flown.values[0], model.mission_K, model.flight_K),
        (flown.values[1], model.mission_load, model.flight_load),
    ):
        variance = 1 / (of_mission**-2 + recorded.size * of_flight**-2)
        mean = variance * recorded.sum() * of_flight**-2
        mission = mean + np.sqrt(variance) * random.standard_normal(PATHS)
        ahead.append(mission + of_flight * random.standard_normal((count, PATHS)))
    return model.ageing(*ahead)


def _observed(diagnosis: Observation, name: str) -> tuple[float, float]:
    """Return the observed change of a component from healthy towards its limit, and its variance."""
    column = columns_of(name)[0]
    moved = level_of(diagnosis.level, name) - getattr(HEALTHY, name)
    return float(-moved if name in FALLING else moved), float(diagnosis.covariance[column, column])
