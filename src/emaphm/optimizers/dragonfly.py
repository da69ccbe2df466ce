"""The dragonfly algorithm, as the thesis ran it and with its two slips corrected."""

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numba import njit

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
    """Dragonfly algorithm: a swarm that keeps together, seeks food (the best) and shuns an enemy (the worst).

    Each agent takes the step w dX + p, dX its last one, at most a tenth of the box's width in every
    component. Its neighbours lie within the radius r in every component and share no coordinate with
    it; where there are two or more, S, A and C are its separation, alignment and cohesion, else 0, dX
    and 0. Then, as in the listing,

    - p = s S + a A + c C + f F + e E where the food is within r, F leading to the food and E depending
      on the enemy if that is within r too;
    - p = r_1 A + r_2 C + r_3 S, r uniform in [0, 1], where there are two or more neighbours;
    - elsewhere the agent flies a Lévy step times its position, with normal numbers as in [1], [2], not
      the uniform ones of the thesis's text, and its next dX is 0.

    S = sum(X - X_j) as in the listing; with the sign in the text it would attract. Agents move one
    after another, so that later ones see where earlier ones went. The variants differ in this alone:

    - ``"thesis"`` is the appendix's listing. E = X_e + X. It clears the list of the neighbours' steps
      before each agent but never that of their positions, so that C sums what is left over from earlier
      agents and iterations too, and divides by the present number of neighbours.
    - ``"corrected"`` has E = X_e - X, as the text, and clears both lists.

    The listing also moves an agent outside the box to the opposite bound before its step. That never
    acts, since each step ends by clipping to the box, and is left out.

    Parameters
    ----------
    lower, upper, population, iterations
        As in `Optimizer`; the thesis gave this one 50 agents and 100 iterations.
    variant
        Which of the two above.
    weight
        Start value of my_c, which scales s, a, c and e and falls to 0 at half time; 0.1 in [1].
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

    def init(self, seed: int) -> DragonflyState:
        """Return a random swarm; as in the listing, its steps too are drawn between the bounds."""
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
        state = self._with_enemy(state, fitness)
        rng = self._random(state.seed, state.iteration)
        progress = state.iteration / self.iterations
        my_c = max(0.0, self.weight * (1 - 2 * progress))
        s, a, c, f = 2 * rng.random(4) * (my_c, my_c, my_c, 1.0)
        w = 0.9 - 0.5 * progress
        growth = 2 * progress if self.growth == "linear" else progress**2
        radius = (self.upper - self.lower) * (0.25 + growth)
        swarm = state.positions.copy(), state.velocities.copy(), state.neighbours.copy()
        _fly(
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
    """Return one hundredth of Lévy-distributed steps [2]."""
    numerator = 0.01 * LEVY_SIGMA * rng.standard_normal(shape)
    return np.asarray(numerator / np.abs(rng.standard_normal(shape)) ** (1 / LEVY_BETA))


@njit(cache=True)
def _fly(
    swarm: tuple[Array, Array, Array],
    scene: tuple[Array, Array, Array, Array, Array],
    weights: tuple[float, float, float, float, float, float],
    chance: tuple[Array, Array],
    thesis: bool,
) -> None:
    """Move each agent of `swarm` (positions, velocities, neighbours) in turn, in place.

    Loops over components: array expressions take three times as long to compile.
    """
    positions, velocities, neighbours = swarm
    lower, upper, radius, food, enemy = scene
    s, a, c, f, e, w = weights
    dice, levy = chance
    patterns = np.empty((3, lower.size))
    S, A, C = patterns
    for i in range(positions.shape[0]):
        if not thesis:
            neighbours[:] = 0.0
        count = _set_patterns(patterns, i, positions, velocities, neighbours, radius)
        near_food = _is_near(positions[i], food, radius)
        near_enemy = _is_near(positions[i], enemy, radius)
        for k in range(lower.size):
            x, v = positions[i, k], velocities[i, k]
            if near_food:
                pull = s * S[k] + a * A[k] + c * C[k] + f * (food[k] - x)
                if near_enemy:
                    pull += e * (enemy[k] + x if thesis else enemy[k] - x)
            else:
                pull = dice[i, 0, k] * A[k] + dice[i, 1, k] * C[k] + dice[i, 2, k] * S[k]
            if near_food or count > 1:
                longest = (upper[k] - lower[k]) / 10
                v = min(max(w * v + pull, -longest), longest)
                x += v
            else:
                v = 0.0
                x += levy[i, k] * x
            positions[i, k], velocities[i, k] = min(max(x, lower[k]), upper[k]), v


@njit(cache=True)
def _set_patterns(
    patterns: Array, i: int, positions: Array, velocities: Array, neighbours: Array, radius: Array
) -> int:
    """List the neighbours of agent `i`, set its S, A and C, the rows of `patterns`; return their number."""
    S, A, C = patterns
    patterns[:] = 0.0
    count = 0
    for j in range(positions.shape[0]):
        if _are_neighbours(positions[i], positions[j], radius):
            for k in range(radius.size):
                neighbours[count, k] = positions[j, k]
                S[k] += positions[i, k] - positions[j, k]
                A[k] += velocities[j, k]
            count += 1
    if count < 2:
        for k in range(radius.size):
            S[k], A[k] = 0.0, velocities[i, k]
        return count
    for k in range(radius.size):
        for j in range(neighbours.shape[0]):
            C[k] += neighbours[j, k]
        A[k], C[k] = A[k] / count, C[k] / count - positions[i, k]
    return count


@njit(cache=True)
def _are_neighbours(x: Array, other: Array, radius: Array) -> bool:
    for k in range(x.size):
        distance = abs(x[k] - other[k])
        if distance > radius[k] or distance == 0:
            return False
    return True


@njit(cache=True)
def _is_near(x: Array, point: Array, radius: Array) -> bool:
    near = True
    for k in range(x.size):
        near &= abs(x[k] - point[k]) <= radius[k]
    return near
