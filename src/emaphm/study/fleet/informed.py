"""Remaining useful life by Bayes' rule from the true population: the best prediction for an unknown unit.

The prior is the true population of the fleet (`population.py`, `growth.py`): the laws with their shares and
ranges of parameters and lives, the drift, and the spread of the stress. The unit's own values are unknown;
only its diagnoses are used. No method that learns from a fleet can have more information on a new unit.

Given the law of each component of the unit and diagnoses without error, the prediction is clairvoyant on law
and true level, but not on the parameters of the law, the rate and the mission.

Each component has `SAMPLE` draws of law, parameters and life, weighted by the likelihood of its diagnoses. In
each draw, level and ageing are estimated by an extended Kalman filter, because the stress of each interval is
random. Components are assumed to be independent; the information from their common stress is not used.
"""

from collections.abc import Mapping, Sequence

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

LEAST_AGE = 1.0
"""Smallest age of a component [h]."""

SMALL = 1e-4
"""Step of the numerical slope of a law, as a share of the life."""

NEVER = "none"
"""Name of the law of a component that does not wear."""

CHANCE = "gamma process"
"""The law with random increments: the filter uses their mean and variance, predictions draw them."""


class Component:
    """One component of a unit: `SAMPLE` draws of law, parameters and life, with level and age in each.

    If a `law` is given, all draws have this law.
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
        spread = np.hypot(wear.spread, _mission_deviation(population.stress))
        life = wear.life / _mean_ageing(population.stress)
        self.life = life * np.exp(spread * random.standard_normal(SAMPLE))
        self.parameters = {
            law: {key: random.uniform(*ends, SAMPLE) for key, ends in LAWS[law].ranges.items()}
            for law in wear.laws
        }
        self.level, self.age = np.zeros(SAMPLE), np.zeros(SAMPLE)
        self.of_level = np.full(SAMPLE, population.new_level**2)
        self.of_both, self.of_age = np.zeros(SAMPLE), np.zeros(SAMPLE)
        self.log_weight = np.zeros(SAMPLE)
        self.hours = 0.0

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

    def slope(self, age: Array, rows: Rows) -> Array:
        """Return the rate of the level per hour of ageing, (n,) [1/h]."""
        step = SMALL * self.life[rows]
        return np.asarray((self.moved(age + step, rows) - self.moved(age, rows)) / step)

    def update(self, diagnosis: Observation) -> None:
        """Update levels, ages and weights of the draws with a diagnosis."""
        level, variance = _observed(diagnosis, self.name)
        h, rows = diagnosis.hours - self.hours, np.arange(SAMPLE)
        uneven = _interval_variance(self.plan) * h
        step = self.moved(self.age + h, rows) - self.moved(self.age, rows)
        bend = self.slope(self.age + h, rows) - self.slope(self.age, rows)
        before = self.of_level + 2 * bend * self.of_both + bend**2 * self.of_age
        before += (step / h) ** 2 * uneven + self._noise(h, rows)
        both = self.of_both + bend * self.of_age + step / h * uneven
        total = before + variance + LEAST_ERROR**2
        innovation = level - self.level - step
        self.log_weight -= 0.5 * (innovation**2 / total + np.log(total))
        self.level += step + before / total * innovation
        self.age = np.maximum(self.age + h + both / total * innovation, LEAST_AGE)
        self.of_age = self.of_age + uneven - both**2 / total
        self.of_level = before * (1 - before / total)
        self.of_both = both * (1 - before / total)
        self.hours = diagnosis.hours

    def drawn(self, random: np.random.Generator) -> tuple[Rows, Array, Array]:
        """Return `PATHS` rows of the draws, sampled by weight, with levels and ages [h], (n,) each."""
        weight = np.exp(self.log_weight - self.log_weight.max())
        rows = random.choice(SAMPLE, PATHS, p=weight / weight.sum())
        deviation = np.sqrt(np.maximum(self.of_level[rows], 1e-12))
        first, second = random.standard_normal((2, PATHS))
        share = self.of_both[rows] / deviation
        rest = np.sqrt(np.maximum(self.of_age[rows] - share**2, 0.0))
        age = self.age[rows] + share * first + rest * second
        return rows, self.level[rows] + deviation * first, np.maximum(age, LEAST_AGE)

    def step(self, age: Array, aged: Array, rows: Rows, random: np.random.Generator) -> Array:
        """Return the change of the levels of components of `age` while they age by `aged` [h], (n,) each."""
        change = self.moved(age + aged, rows) - self.moved(age, rows)
        if CHANCE in self.laws:
            jumps = self.parameters[CHANCE]["jumps"][rows]
            drawn = self.wear.limit * random.gamma(jumps * aged / self.life[rows]) / jumps
            change = np.where(self.law[rows] == self.laws.index(CHANCE), drawn, change)
        drift = self.plan.drawn_from.drift * np.sqrt(aged / self.life[rows])
        wears = self.law[rows] < len(self.laws) - 1
        return np.asarray(change + np.where(wears, drift * random.standard_normal(rows.size), 0.0))

    def _noise(self, hours: float, rows: Rows) -> Array:
        """Return the variance that drift and jumps add to the levels within `hours`, (n,)."""
        lives = hours / self.life[rows]
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
    samples = []
    for i, diagnosis in enumerate(evidence.used[: max(at) + 1]):
        for component in components:
            component.update(diagnosis)
        samples += [_lives(components, plan, random)] * list(at).count(i)
    return samples


def _lives(components: list[Component], plan: FleetPlan, random: np.random.Generator) -> Array:
    """Return a sample of the RUL of a unit [h], (`PATHS`,), from the draws of its components."""
    life = np.full(PATHS, np.inf)
    states = [component.drawn(random) for component in components]
    for component, (_, level, _) in zip(components, states, strict=True):
        life[level >= component.wear.limit] = 0.0
    spread = np.sqrt(_interval_variance(plan) / STEP)
    for hours in np.arange(0.0, LONGEST_LIFE, STEP):
        if np.isfinite(life).all():
            break
        aged = STEP * np.maximum(1 + spread * random.standard_normal(PATHS), 0.1)
        after = []
        for component, (rows, level, age) in zip(components, states, strict=True):
            change = component.step(age, aged, rows, random)
            with np.errstate(divide="ignore", invalid="ignore"):
                passed = hours + STEP * (component.wear.limit - level) / change
            crosses = (level < component.wear.limit) & (level + change >= component.wear.limit)
            life = np.where(crosses, np.minimum(life, passed), life)
            after.append((rows, level + change, age + aged))
        states = after
    return life


def _observed(diagnosis: Observation, name: str) -> tuple[float, float]:
    """Return the observed change of a component from healthy towards its limit, and its variance."""
    column = columns_of(name)[0]
    moved = level_of(diagnosis.level, name) - getattr(HEALTHY, name)
    return float(-moved if name in FALLING else moved), float(diagnosis.covariance[column, column])


def _mission_deviation(stress: StressModel) -> float:
    """Return the standard deviation of the logarithm of ageing between units."""
    return float(np.hypot(stress.mission_K / stress.doubling * np.log(2), 3 * stress.mission_load))


def _mean_ageing(stress: StressModel) -> float:
    """Return the mean ageing per hour [-] of a median mission: above 1, because its law is convex."""
    of_heat = np.exp(0.5 * (stress.flight_K / stress.doubling * np.log(2)) ** 2)
    return float(of_heat * (1 + 3 * stress.flight_load**2))


def _interval_variance(plan: FleetPlan) -> float:
    """Return the variance of ageing per hour [h²/h], from the spread of the stress between check flights."""
    stress = plan.drawn_from.stress
    spread = np.hypot(stress.flight_K / stress.doubling * np.log(2), 3 * stress.flight_load)
    return float(spread**2 * plan.interval)
