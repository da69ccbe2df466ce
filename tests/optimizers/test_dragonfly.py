"""The dragonfly algorithm against its published equations."""

import itertools
import math
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.optimizers import Dragonfly
from emaphm.optimizers import dragonfly as dragonfly_module
from emaphm.optimizers.dragonfly import DragonflyState, Growth, Variant


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"variant": "theses"}, r"unknown variant 'theses' \(did you mean 'thesis'\?\)"),
        ({"growth": "lineal"}, r"unknown growth 'lineal' \(did you mean 'linear'\?\)"),
        ({"weight": -0.1}, "weight must be at least 0 and finite, got -0.1"),
    ],
)
def test_invalid_settings_of_the_dragonfly_are_refused(bad: dict[str, Any], message: str) -> None:
    with pytest.raises(MethodError, match=message):
        Dragonfly(np.zeros(2), np.ones(2), **bad)


def test_the_levy_scale_is_that_of_mantegna() -> None:
    assert pytest.approx(0.696575, abs=1e-6) == dragonfly_module.LEVY_SIGMA  # Mantegna (1994), beta = 1.5


@pytest.fixture
def loaded_dice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace uniform numbers by 1/2 and normal numbers by 1, so that a step can be computed by hand."""
    dice = SimpleNamespace(random=partial(np.full, fill_value=0.5), standard_normal=np.ones)
    drawn = Dragonfly._random
    monkeypatch.setattr(
        Dragonfly, "_random", staticmethod(lambda seed, iteration: dice if iteration else drawn(seed, 0))
    )


# Five agents on [0, 1] with r = 1/4, at rest; the food is the last agent, out of reach of the others.
# Each agent moves by (S + A + C) / 2, at most 0.1. In the first iteration
#   agent 0 at 0.30 lists 0.10, 0.20, 0.50: S = 0.1, C = 0.8/3 - 0.3, and moves by 1/30 to 1/3;
#   agent 1 at 0.10 lists 1/3, 0.20, with a stale 0.50: S = 0.2 - 8/15, C = (8/15 [+ 0.5])/2 - 0.1,
#   and A = 1/60, since one of its two neighbours has just moved;
#   agents 2, 3 list two each, agent 4 none: 0.50 remains as the third entry.
# In the second, from new positions, agent 0 at 0.10 lists 0.20, 0.30, with the same stale 0.50:
# S = -0.3, C = (0.5 [+ 0.5])/2 - 0.1.
@pytest.mark.usefixtures("loaded_dice")
@pytest.mark.parametrize(
    ("variant", "agent_1", "agent_0_later"),
    [
        ("thesis", 0.1 + (0.2 - 8 / 15 + 1 / 60 + 31 / 60 - 0.1) / 2, 0.1 + (-0.3 + 0.5 - 0.1) / 2),
        ("corrected", 0.1 + (0.2 - 8 / 15 + 1 / 60 + 16 / 60 - 0.1) / 2, 0.1 + (-0.3 + 0.25 - 0.1) / 2),
    ],
)
def test_only_the_variant_of_the_thesis_has_stale_neighbours_in_its_cohesion(
    variant: Variant, agent_1: float, agent_0_later: float
) -> None:
    optimizer = Dragonfly(np.zeros(1), np.ones(1), population=5, iterations=10**9, variant=variant)
    fitness = [1, 1, 1, 1, 0]

    def at(state: DragonflyState, *positions: float) -> DragonflyState:
        return replace(state, positions=np.array(positions)[:, None], velocities=np.zeros((5, 1)))

    first = optimizer.tell(at(optimizer.init(0), 0.30, 0.10, 0.20, 0.50, 0.95), fitness)
    # r and w deviate by 1e-9 in the first iterations of a run of this length.
    assert first.positions[:2, 0] == pytest.approx([1 / 3, agent_1], abs=1e-8)
    second = optimizer.tell(at(first, 0.10, 0.20, 0.30, 0.60, 0.95), fitness)
    assert second.positions[0, 0] == pytest.approx(agent_0_later, abs=1e-8)


class PublishedSwarm:
    """Equations 3.1 to 3.8 of Mirjalili (2016), one agent and component at a time, with the fixed numbers."""

    def __init__(self, optimizer: Dragonfly, state: DragonflyState) -> None:
        self.optimizer = optimizer
        self.X: list[list[float]] = state.positions.tolist()
        self.V: list[list[float]] = state.velocities.tolist()
        self.food: list[float] = []
        self.enemy: list[float] = []
        self.food_fitness, self.enemy_fitness = math.inf, -math.inf
        self.listed: list[list[float]] = []
        self.moves: set[tuple[bool, bool, bool]] = set()

    def evaluate(self, fitness: Array) -> None:
        """Update food and enemy."""
        for x, value in zip(self.X, fitness, strict=True):
            if value < self.food_fitness:
                self.food, self.food_fitness = list(x), value
            inside = all(0 < component < 1 for component in x)
            if value > self.enemy_fitness and inside:
                self.enemy, self.enemy_fitness = list(x), value

    def move(self, iteration: int) -> None:
        """Move the agents in turn."""
        t = iteration / self.optimizer.iterations
        weight = max(0, self.optimizer.weight - 2 * self.optimizer.weight * t)
        for i in range(len(self.X)):
            r = 0.25 + (2 * t if self.optimizer.growth == "linear" else t * t)
            self._move_agent(i, r, 0.9 - 0.5 * t, weight)

    def _reaches(self, i: int, other: list[float], r: float) -> bool:
        return all(abs(a - b) <= r for a, b in zip(self.X[i], other, strict=True))

    def _flock(self, i: int, r: float) -> list[int]:
        x = self.X[i]
        near = [j for j, other in enumerate(self.X) if self._reaches(i, other, r)]
        near = [j for j in near if all(a != b for a, b in zip(x, self.X[j], strict=True))]
        stale = self.listed[len(near) :] if self.optimizer.variant == "thesis" else []
        self.listed = [list(self.X[j]) for j in near] + stale
        return near

    def _move_agent(self, i: int, r: float, w: float, weight: float) -> None:
        near = self._flock(i, r)
        flock, food, enemy = len(near) > 1, self._reaches(i, self.food, r), self._reaches(i, self.enemy, r)
        self.moves.add((flock, food, enemy))
        old = list(self.X[i])
        for k, x in enumerate(old):
            v = self.V[i][k]
            S, A, C, E = 0.0, v, 0.0, 0.0
            if flock:
                S = -sum(self.X[j][k] - x for j in near)
                A = sum(self.V[j][k] for j in near) / len(near)
                C = sum(other[k] for other in self.listed) / len(near) - x
            if enemy:
                E = self.enemy[k] + x if self.optimizer.variant == "thesis" else self.enemy[k] - x
            if food:
                v = weight * (S + A + C + E) + (self.food[k] - x) + w * v
            elif flock:
                v = (S + A + C) / 2 + w * v
            else:
                v = 0.01 * 0.696575 * x
            step = max(-0.1, min(0.1, v))
            self.V[i][k] = step if food or flock else 0.0
            self.X[i][k] = max(0.0, min(1.0, x + step))


@pytest.mark.usefixtures("loaded_dice")
@pytest.mark.parametrize("variant", ["thesis", "corrected"])
@pytest.mark.parametrize("growth", ["linear", "quadratic"])
def test_the_swarm_follows_the_published_equations(variant: Variant, growth: Growth) -> None:
    all_moves: set[tuple[bool, bool, bool]] = set()
    for seed in range(10):
        optimizer = Dragonfly(np.zeros(2), np.ones(2), 9, 40, variant=variant, growth=growth, weight=0.1)
        state = optimizer.init(seed)
        published = PublishedSwarm(optimizer, state)
        for iteration in range(1, 13):
            # Ripples, with the worst values at the walls, where no enemy is allowed.
            fitness = np.sum(np.sin(17 * state.positions) + 9 * (state.positions - 0.5) ** 2, axis=1)
            published.evaluate(fitness)
            published.move(iteration)
            state = optimizer.tell(state, fitness)
            # Rounding accumulated over 12 steps, and the six digits of the Lévy scale.
            np.testing.assert_allclose(state.positions, published.X, atol=1e-6)
            np.testing.assert_allclose(state.velocities, published.V, atol=1e-6)
        all_moves |= published.moves
    assert all_moves == set(itertools.product((False, True), repeat=3))
