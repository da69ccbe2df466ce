"""Differential evolution, DE/rand/1/bin."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.optimizers.base import Optimizer, State


@dataclass(frozen=True, eq=False)
class DifferentialEvolutionState(State):
    """State of n vectors in d dimensions, each with a trial vector (`positions`) that may replace it.

    `parents`, shape (n, d), are the vectors and `parents_fitness`, shape (n,), their fitness; before the
    first evaluation the trial vectors are the vectors themselves.
    """

    parents: Array
    parents_fitness: Array


@dataclass(frozen=True, eq=False)
class DifferentialEvolution(Optimizer[DifferentialEvolutionState]):
    """Differential evolution in its basic form, DE/rand/1/bin.

    A trial vector u_i replaces the vector x_i if its fitness is not worse. In each component with probability
    CR, and in at least one component, u_i has the value of the mutant

        v_i = x_r1 + F (x_r2 - x_r3),

    with r1, r2, r3 and i all different; otherwise it has the value of x_i [1]. A component of v_i beyond a
    bound is drawn uniformly between that bound and x_r1 (bounce-back, [2]), so that vectors approach an
    optimum on a bound and remain different. Several rules were compared on spheres and Rastrigin functions in
    [0, 1]^8 with the optimum in a corner or inside: clipping is the fastest towards a corner, but moves all
    vectors to the bounds, where the differences vanish; with reflection and with the midpoint to x_i the
    distance from a corner after 200 generations is a hundred to ten thousand times as large, and with new
    random values larger still.

    Parameters
    ----------
    lower, upper, population, iterations
        As in `Optimizer`; [1] advises 5 d to 10 d vectors.
    scale
        F. [1] recommends 0.5 as a first choice.
    crossover
        CR. [1] calls 0.1 a good first choice, but recommends to try 0.9 or 1 first, which are often faster.
        The default is 0.9, because 0.1 changes mostly one component at a time, and the parameters of a
        fitted model interact.

    Raises
    ------
    MethodError
        As in `Optimizer`; or the population is below 4, scale lies outside ]0, 2], or crossover lies
        outside [0, 1].

    References
    ----------
    .. [1] R. Storn and K. Price, "Differential evolution - a simple and efficient heuristic for global
       optimization over continuous spaces", Journal of Global Optimization 11, 1997.
    .. [2] K. V. Price, R. M. Storn and J. A. Lampinen, "Differential evolution: a practical approach to
       global optimization", Springer, 2005.
    """

    least_population: ClassVar[int] = 4  # a vector, and three other vectors for its mutant

    scale: float = 0.5
    crossover: float = 0.9

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.scale <= 2:
            raise MethodError(f"scale must be above 0 and at most 2, got {self.scale:g}")
        if not 0 <= self.crossover <= 1:
            raise MethodError(f"crossover must be between 0 and 1, got {self.crossover:g}")

    def init(self, seed: int) -> DifferentialEvolutionState:
        """Return the state with random vectors."""
        positions = self._scatter(self._random(seed, 0))
        return self._start(
            DifferentialEvolutionState,
            seed,
            positions,
            parents=positions,
            parents_fitness=np.full(self.population, np.inf),
        )

    def _move(self, state: DifferentialEvolutionState, fitness: Array) -> DifferentialEvolutionState:
        accepted = fitness <= state.parents_fitness
        parents = np.where(accepted[:, None], state.positions, state.parents)
        rng = self._random(state.seed, state.iteration)
        mutants = self._mutants(parents, rng)
        crossed = rng.random(parents.shape) < self.crossover
        crossed[np.arange(self.population), rng.integers(self.lower.size, size=self.population)] = True
        return replace(
            state,
            positions=np.where(crossed, mutants, parents),
            parents=parents,
            parents_fitness=np.where(accepted, fitness, state.parents_fitness),
        )

    def _mutants(self, parents: Array, rng: np.random.Generator) -> Array:
        base, minuend, subtrahend = parents[_three_other_indices(rng, self.population)]
        mutants = base + self.scale * (minuend - subtrahend)
        clipped = np.clip(mutants, self.lower, self.upper)
        outside = np.nonzero(mutants != clipped)
        bound, start = clipped[outside], base[outside]
        mutants[outside] = start + rng.random(bound.size) * (bound - start)
        return np.asarray(np.clip(mutants, self.lower, self.upper))


def _three_other_indices(rng: np.random.Generator, n: int) -> NDArray[np.intp]:
    """Return, for each of `n` indices, three different indices other than itself, shape (3, n)."""
    counts = np.array([[n - 1], [n - 2], [n - 3]])
    first, second, third = 1 + (rng.random((3, n)) * counts).astype(np.intp)
    second += second >= first
    third += third >= np.minimum(first, second)
    third += third >= np.maximum(first, second)
    return np.asarray((np.stack((first, second, third)) + np.arange(n)) % n)
