"""Dragonfly algorithm, as published in the thesis, and with its two errors corrected."""

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import MethodError, nearest
from emaphm.optimizers.base import Optimizer, State

Variant = Literal["thesis", "corrected"]
Growth = Literal["linear", "quadratic"]
LEVY_BETA = 1.5
"""Index of the Lévy flight (thesis 5.3.1)."""

LEVY_SIGMA = (
    math.gamma(1 + LEVY_BETA)
    * math.sin(math.pi * LEVY_BETA / 2)
    / (math.gamma((1 + LEVY_BETA) / 2) * LEVY_BETA * 2 ** ((LEVY_BETA - 1) / 2))
) ** (1 / LEVY_BETA)
"""Standard deviation of the numerator in Mantegna's generator of Lévy steps [2]."""


@dataclass(frozen=True, eq=False)
class DragonflyState(State):
    """State of a swarm of n dragonflies in d dimensions.

    `velocities`, shape (n, d), are the last steps; `enemy_point`, shape (d,), is the worst point
    evaluated strictly inside the box and `enemy_fitness` its fitness. `neighbours`, shape (n - 1, d),
    is the list of neighbouring positions as the last agent left it; rows never written are 0.
    """

    velocities: Array
    enemy_point: Array
    enemy_fitness: float
    neighbours: Array


@dataclass(frozen=True, eq=False)
class Dragonfly(Optimizer[DragonflyState]):
    """Dragonfly algorithm: a swarm that keeps together and moves towards food (the best point).

    It is meant to avoid an enemy (the worst point); but the step of the text for that, X_e - X, leads towards
    the enemy.

    Each agent makes the step w dX + p, with dX its last step, limited to a tenth of the box's width in every
    component. Its neighbours are the agents within the radius r in every component that share no coordinate
    with it. With two or more neighbours, S, A and C are its separation, alignment and cohesion; otherwise
    they are 0, dX and 0. Then, as in the listing,

    - p = s S + a A + c C + f F + e E if the food is within r, with F towards the food, and E depending on
      the enemy if the enemy is also within r;
    - otherwise p = r_1 A + r_2 C + r_3 S, with r_1, r_2, r_3 uniform in [0, 1], if there are two or more
      neighbours;
    - otherwise the agent makes a Lévy step times its position, with normal numbers as in [1], [2] instead of
      the uniform numbers of the thesis's text, and its next dX is 0.

    S = sum(X - X_j) as in the listing; with the sign in the text it would attract. Agents move one after
    another, so that later agents use the new positions of earlier agents. The variants differ in E and C:

    - ``"thesis"`` is the listing of the appendix, with E = X_e + X. It clears the list of the neighbours'
      steps before each agent, but never the list of their positions, so that C includes positions of earlier
      agents and iterations, and is divided by the present number of neighbours.
    - ``"corrected"`` has E = X_e - X, as in the text, and clears both lists.

    The listing also moves an agent outside the box to the opposite bound before its step. This never occurs,
    because each step ends by clipping to the box, and is left out.

    Parameters
    ----------
    lower, upper, population, iterations
        As in `Optimizer`; the thesis uses 50 agents and 100 iterations.
    variant
        ``"thesis"`` or ``"corrected"``, as above.
    weight
        Initial value of my_c, which scales s, a, c and e and falls to 0 after half of the iterations; 0.1 in
        [1].
    growth
        r is the box's width times 1/4 + 2 it/max (``"linear"``, the listing) or times
        1/4 + (it/max)² (``"quadratic"``, the thesis's text).

    Raises
    ------
    MethodError
        As in `Optimizer`; or variant or growth is unknown, or weight is negative or not finite.

    References
    ----------
    .. [1] S. Mirjalili, "Dragonfly algorithm: a new meta-heuristic optimization technique for solving
       single-objective, discrete, and multi-objective problems", Neural Computing and Applications 27,
       2016. Thesis 5.3 and appendix follow it.
    .. [2] R. N. Mantegna, "Fast, accurate algorithm for numerical simulation of Lévy stable stochastic
       processes", Physical Review E 49, 1994.
    """

    iterations: int = 100
    variant: Variant = "corrected"
    weight: float = 0.01
    growth: Growth = "linear"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.variant not in get_args(Variant):
            raise MethodError(f"unknown variant '{self.variant}'{nearest(self.variant, get_args(Variant))}")
        if self.growth not in get_args(Growth):
            raise MethodError(f"unknown growth '{self.growth}'{nearest(self.growth, get_args(Growth))}")
        if not 0 <= self.weight < math.inf:
            raise MethodError(f"weight must be at least 0 and finite, got {self.weight:g}")

    def prepare(self) -> None:
        """Import and compile the flight by one move of a swarm; all swarms have the same types."""
        self.tell(self.init(0), np.zeros(self.population))

    def init(self, seed: int) -> DragonflyState:
        """Return a random swarm; as in the listing, its steps are also drawn between the bounds."""
        rng = self._random(seed, 0)
        positions = self._scatter(rng)
        return self._start(
            DragonflyState,
            seed,
            positions,
            velocities=self._scatter(rng),
            enemy_point=np.zeros(self.lower.size),
            enemy_fitness=-math.inf,
            neighbours=np.zeros((self.population - 1, self.lower.size)),
        )

    def _move(self, state: DragonflyState, fitness: Array) -> DragonflyState:
        # This imports Numba, which takes 0.1 s.
        from emaphm.optimizers.dragonfly_flight import fly

        state = self._with_enemy(state, fitness)
        rng = self._random(state.seed, state.iteration)
        progress = state.iteration / self.iterations
        my_c = max(0.0, self.weight * (1 - 2 * progress))
        s, a, c, f = 2 * rng.random(4) * (my_c, my_c, my_c, 1.0)
        w = 0.9 - 0.5 * progress
        growth = 2 * progress if self.growth == "linear" else progress**2
        radius = (self.upper - self.lower) * (0.25 + growth)
        swarm = state.positions.copy(), state.velocities.copy(), state.neighbours.copy()
        fly(
            swarm,
            tuple(np.stack((self.lower, self.upper, radius, state.best_point, state.enemy_point))),
            (s, a, c, f, my_c, w),
            (rng.random((self.population, 3, self.lower.size)), _levy_steps(rng, state.positions.shape)),
            self.variant == "thesis",
        )
        positions, velocities, neighbours = swarm
        return replace(state, positions=positions, velocities=velocities, neighbours=neighbours)

    def _with_enemy(self, state: DragonflyState, fitness: Array) -> DragonflyState:
        inside = np.all((state.positions > self.lower) & (state.positions < self.upper), axis=1)
        eligible = np.where(inside, fitness, -np.inf)
        worst = int(np.argmax(eligible))
        if eligible[worst] <= state.enemy_fitness:
            return state
        return replace(state, enemy_point=state.positions[worst], enemy_fitness=float(eligible[worst]))


def _levy_steps(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Return Lévy-distributed steps [2], divided by 100."""
    numerator = 0.01 * LEVY_SIGMA * rng.standard_normal(shape)
    return np.asarray(numerator / np.abs(rng.standard_normal(shape)) ** (1 / LEVY_BETA))
