"""Grey wolf optimiser."""

from bisect import bisect_left
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from emaphm.arrays import Array
from emaphm.optimizers.base import Optimizer, State

LEADERS = 3
"""Number of leaders: alpha, beta and delta."""


@dataclass(frozen=True, eq=False)
class GreyWolfState(State):
    """State of a pack of wolves in d dimensions.

    `leaders`, shape (3, d), are alpha, beta and delta, and `leaders_fitness`, shape (3,), their fitness, inf
    before a leader exists.
    """

    leaders: Array
    leaders_fitness: Array


@dataclass(frozen=True, eq=False)
class GreyWolf(Optimizer[GreyWolfState]):
    """Grey wolf optimiser: each wolf moves to the mean of three points, one near each of three leaders.

    For a wolf at X and a leader at X_l the point is X_l - A |C X_l - X|, with A = a (2 r_1 - 1), C = 2 r_2,
    and r_1, r_2 uniform in [0, 1], drawn for each wolf, leader and component. The only parameter, a, falls
    linearly from 2 to 0 over the run. Wolves that leave the box are moved to its bound.

    The leaders alpha, beta and delta are the "three best solutions" of [1], updated as in its authors' code:
    a wolf replaces the first leader that is worse than the wolf, and the replaced leader does not move to the
    next place. With the best three of all evaluated points instead, the results of [1] are not reproduced:
    the result for the sphere is a thousand times smaller, that for Rastrigin's function larger.

    C scales the leader's coordinates, so that the pack contracts towards the origin of the coordinates; the
    algorithm is worse if the optimum is elsewhere [2]. This is the published algorithm and is not changed:
    compare it with other algorithms on problems whose optimum is not at the origin.

    Parameters
    ----------
    lower, upper, population, iterations
        As in `Optimizer`; the paper has 30 wolves and 500 iterations.

    Raises
    ------
    MethodError
        As in `Optimizer`; or the population is below 3.

    References
    ----------
    .. [1] S. Mirjalili, S. M. Mirjalili and A. Lewis, "Grey wolf optimizer", Advances in Engineering
       Software 69, 2014.
    .. [2] P. Niu, S. Niu, N. Liu and L. Chang, "The defect of the grey wolf optimization algorithm and its
       verification method", Knowledge-Based Systems 171, 2019.
    """

    least_population: ClassVar[int] = LEADERS

    def init(self, seed: int) -> GreyWolfState:
        """Return a random pack without leaders."""
        positions = self._scatter(self._random(seed, 0))
        return self._start(
            GreyWolfState,
            seed,
            positions,
            leaders=positions[:LEADERS],
            leaders_fitness=np.full(LEADERS, np.inf),
        )

    def _move(self, state: GreyWolfState, fitness: Array) -> GreyWolfState:
        leaders, leaders_fitness = _updated_leaders(state, fitness)
        a = 2 * (1 - (state.iteration - 1) / self.iterations)
        r = self._random(state.seed, state.iteration).random((2, *state.positions.shape[:1], *leaders.shape))
        points = leaders - a * (2 * r[0] - 1) * np.abs(2 * r[1] * leaders - state.positions[:, None])
        return replace(
            state,
            positions=np.clip(points.sum(axis=1) / LEADERS, self.lower, self.upper),
            leaders=leaders,
            leaders_fitness=leaders_fitness,
        )


def _updated_leaders(state: GreyWolfState, fitness: Array) -> tuple[Array, Array]:
    """Return the leaders and their fitness after each wolf in turn has been compared with them."""
    leaders, ranks = state.leaders.copy(), state.leaders_fitness.tolist()
    for i in np.nonzero(fitness < ranks[-1])[0]:
        place = bisect_left(ranks, fitness[i])
        if place < LEADERS and fitness[i] < ranks[place]:
            leaders[place], ranks[place] = state.positions[i], fitness[i]
    return leaders, np.array(ranks)
