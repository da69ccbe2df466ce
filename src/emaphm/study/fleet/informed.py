"""The remaining useful life by Bayes' rule from the true population: the best without knowing the unit.

It knows what the fleet is drawn from (`population.py`, `growth.py`): which laws, in which shares, with which
ranges of parameters and lives, the drift and the spread of the stress. It does not know which of these a unit
has, and sees its diagnoses only. No method that learns from a fleet can know more of a new unit.

Given the law of each of the unit's components and diagnoses without error, it is a clairvoyant who knows law
and true level, but neither the parameters of the law, nor the rate, nor the mission.

Each component has `SAMPLE` draws of law, parameters and life, weighted by the likelihood of its diagnoses. In
each, level and ageing are followed by an extended Kalman filter, since the stress of each stretch is random.
Components are taken as independent: what their common stress adds is left out.
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
"""Draws of each component: some hundred of them carry the weight late in life, even with the level known."""

PATHS = 1000
STEP = 50.0
"""Of the future [h]."""

LONGEST_LIFE = 12_000.0
"""How far is looked [h]."""

LEAST_AGE = 1.0
"""Of a component [h]."""

SMALL = 1e-4
"""Share of a life over which the slope of a law is taken."""

NEVER = "none"
"""The law of a component that does not wear."""

CHANCE = "gamma process"
"""The law whose increments are chance: it is followed by their mean and variance, and drawn as it is."""


class Component:
    """One component of a unit: `SAMPLE` draws of what it may be, and level and ageing in each.

    Of a `law` that is given, they have that one.
    """

    def __init__(
        self, name: str, wear: Wear, plan: FleetPlan, random: np.random.Generator, law: str | None = None
    ) -> None:
        self.name, self.wear, self.plan = name, wear, plan
        population = plan.drawn_from
        self.laws = (*wear.laws, NEVER)
        shares = [*(wear.share * share for share in wear.laws.values()), 1 - wear.share]
        if law is not None:
            shares = [float(one == law) for one in self.laws]
        self.law = random.choice(len(self.laws), size=SAMPLE, p=shares)
        spread = np.hypot(wear.spread, _of_missions(population.stress))
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
        """Return how far the draws `rows` (n,) have moved the level at their `age` [h], both (n,)."""
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
        """Return by how much the level moves in an hour of ageing, (n,) [1/h]."""
        step = SMALL * self.life[rows]
        return np.asarray((self.moved(age + step, rows) - self.moved(age, rows)) / step)

    def see(self, one: Observation) -> None:
        """Weigh the draws by a diagnosis."""
        level, variance = _seen(one, self.name)
        h, everyone = one.hours - self.hours, np.arange(SAMPLE)
        uneven = _of_stretches(self.plan) * h
        step = self.moved(self.age + h, everyone) - self.moved(self.age, everyone)
        bend = self.slope(self.age + h, everyone) - self.slope(self.age, everyone)
        before = self.of_level + 2 * bend * self.of_both + bend**2 * self.of_age
        before += (step / h) ** 2 * uneven + self._noise(h, everyone)
        both = self.of_both + bend * self.of_age + step / h * uneven
        total = before + variance + LEAST_ERROR**2
        innovation = level - self.level - step
        self.log_weight -= 0.5 * (innovation**2 / total + np.log(total))
        self.level += step + before / total * innovation
        self.age = np.maximum(self.age + h + both / total * innovation, LEAST_AGE)
        self.of_age = self.of_age + uneven - both**2 / total
        self.of_level = before * (1 - before / total)
        self.of_both = both * (1 - before / total)
        self.hours = one.hours

    def drawn(self, random: np.random.Generator) -> tuple[Rows, Array, Array]:
        """Return `PATHS` rows of the draws by their weights, with levels and ages [h], (n,) each."""
        weight = np.exp(self.log_weight - self.log_weight.max())
        rows = random.choice(SAMPLE, PATHS, p=weight / weight.sum())
        deviation = np.sqrt(np.maximum(self.of_level[rows], 1e-12))
        first, second = random.standard_normal((2, PATHS))
        share = self.of_both[rows] / deviation
        rest = np.sqrt(np.maximum(self.of_age[rows] - share**2, 0.0))
        age = self.age[rows] + share * first + rest * second
        return rows, self.level[rows] + deviation * first, np.maximum(age, LEAST_AGE)

    def step(self, age: Array, aged: Array, rows: Rows, random: np.random.Generator) -> Array:
        """Return by how much levels move while components of `age` age by `aged` [h], (n,) each."""
        change = self.moved(age + aged, rows) - self.moved(age, rows)
        if CHANCE in self.laws:
            jumps = self.parameters[CHANCE]["jumps"][rows]
            drawn = self.wear.limit * random.gamma(jumps * aged / self.life[rows]) / jumps
            change = np.where(self.law[rows] == self.laws.index(CHANCE), drawn, change)
        drift = self.plan.drawn_from.drift * np.sqrt(aged / self.life[rows])
        wears = self.law[rows] < len(self.laws) - 1
        return np.asarray(change + np.where(wears, drift * random.standard_normal(rows.size), 0.0))

    def _noise(self, hours: float, rows: Rows) -> Array:
        """Return the variance by which drift and jumps add to the levels in `hours`, (n,)."""
        lives = hours / self.life[rows]
        variance = np.where(self.law[rows] < len(self.laws) - 1, self.plan.drawn_from.drift**2 * lives, 0.0)
        if CHANCE in self.laws:
            jumps = self.wear.limit**2 * lives / self.parameters[CHANCE]["jumps"][rows]
            variance = variance + np.where(self.law[rows] == self.laws.index(CHANCE), jumps, 0.0)
        return np.asarray(variance)


def informed(
    evidence: Evidence, plan: FleetPlan, at: Sequence[int], laws: Mapping[str, str] | None = None
) -> list[Array]:
    """Return samples of the RUL [h] after the explained diagnoses numbered `at`, increasing, (`PATHS`,).

    `laws` are those of the components that wear, the others being known not to; all unknown if left out.
    """
    random = stream(plan.seed, "informed", evidence.unit)
    population: Population = plan.drawn_from
    components = [
        Component(name, wear, plan, random, None if laws is None else laws.get(name, NEVER))
        for name, wear in population.wear.items()
    ]
    found = []
    for i, one in enumerate(evidence.used[: max(at) + 1]):
        for component in components:
            component.see(one)
        found += [_lives(components, plan, random)] * list(at).count(i)
    return found


def _lives(components: list[Component], plan: FleetPlan, random: np.random.Generator) -> Array:
    life = np.full(PATHS, np.inf)
    states = [one.drawn(random) for one in components]
    for one, (_, level, _) in zip(components, states, strict=True):
        life[level >= one.wear.limit] = 0.0
    spread = np.sqrt(_of_stretches(plan) / STEP)
    for hours in np.arange(0.0, LONGEST_LIFE, STEP):
        if np.isfinite(life).all():
            break
        aged = STEP * np.maximum(1 + spread * random.standard_normal(PATHS), 0.1)
        after = []
        for one, (rows, level, age) in zip(components, states, strict=True):
            change = one.step(age, aged, rows, random)
            with np.errstate(divide="ignore", invalid="ignore"):
                passed = hours + STEP * (one.wear.limit - level) / change
            crosses = (level < one.wear.limit) & (level + change >= one.wear.limit)
            life = np.where(crosses, np.minimum(life, passed), life)
            after.append((rows, level + change, age + aged))
        states = after
    return life


def _seen(one: Observation, name: str) -> tuple[float, float]:
    """Return how far a component has moved from healthy towards its limit, and the variance of that."""
    column = columns_of(name)[0]
    moved = level_of(one.level, name) - getattr(HEALTHY, name)
    return float(-moved if name in FALLING else moved), float(one.covariance[column, column])


def _of_missions(stress: StressModel) -> float:
    """Return the standard deviation of the logarithm of ageing from unit to unit."""
    return float(np.hypot(stress.mission_K / stress.doubling * np.log(2), 3 * stress.mission_load))


def _mean_ageing(stress: StressModel) -> float:
    """Return the mean ageing in an hour [-] of a median mission: above 1, as its law is convex."""
    of_heat = np.exp(0.5 * (stress.flight_K / stress.doubling * np.log(2)) ** 2)
    return float(of_heat * (1 + 3 * stress.flight_load**2))


def _of_stretches(plan: FleetPlan) -> float:
    """Return the variance of ageing in an hour [h²/h], from the spread between check flights."""
    stress = plan.drawn_from.stress
    spread = np.hypot(stress.flight_K / stress.doubling * np.log(2), 3 * stress.flight_load)
    return float(spread**2 * plan.interval)
