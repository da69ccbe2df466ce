"""Real-coded genetic algorithm of Deb and others."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.optimizers.base import Optimizer, State

NEAREST = 1e-14
"""Difference, relative to the box's width, below which two genes count as equal and are not crossed."""


@dataclass(frozen=True, eq=False)
class GeneticState(State):
    """State of n parents, with d genes each, and their children (`positions`).

    `parents`, shape (n, d), are the best n evaluated points, best first, and `parents_fitness`, shape (n,),
    their fitness; before the first evaluation they are the first population, with the fitness inf.
    """

    parents: Array
    parents_fitness: Array


@dataclass(frozen=True, eq=False)
class Genetic(Optimizer[GeneticState]):
    """Genetic algorithm with real genes: simulated binary crossover and polynomial mutation.

    The best n of the parents and their children survive. Parents are chosen by binary tournament, with each
    parent in two tournaments, and crossed in pairs with probability p_c:

    - crossover changes each gene with probability 1/2, to (x_1 + x_2) / 2 ± beta |x_1 - x_2| / 2 for the two
      children in random order. The spread factor beta has the density 0.5 (eta_c + 1) beta^eta_c up to 1 and
      0.5 (eta_c + 1) / beta^(eta_c + 2) above. It is truncated where the child would leave the box,
      separately on each side, and normalised to 1 [1], [2];
    - mutation changes each gene with probability 1/d by delta times the box's width. The density of delta
      is proportional to (1 - |delta|)^eta_m, truncated at the bounds, with probability 1/2 on each side [2],
      [3].

    Parameters
    ----------
    lower, upper, population, iterations
        As in `Optimizer`; [2] has 100 parents.
    crossover_probability
        p_c, 0.9 in [2].
    crossover_index, mutation_index
        eta_c and eta_m, 20 each in [2]; with larger indices, children are nearer to their parents.

    Raises
    ------
    MethodError
        As in `Optimizer`; or the probability lies outside [0, 1], or an index is negative or not finite.

    References
    ----------
    .. [1] K. Deb and R. B. Agrawal, "Simulated binary crossover for continuous search space", Complex
       Systems 9, 1995.
    .. [2] K. Deb, A. Pratap, S. Agarwal and T. Meyarivan, "A fast and elitist multiobjective genetic
       algorithm: NSGA-II", IEEE Transactions on Evolutionary Computation 6, 2002.
    .. [3] K. Deb and M. Goyal, "A combined genetic adaptive search (GeneAS) for engineering design",
       Computer Science and Informatics 26, 1996.
    """

    crossover_probability: float = 0.9
    crossover_index: float = 20.0
    mutation_index: float = 20.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.crossover_probability <= 1:
            raise MethodError(
                f"crossover_probability must be between 0 and 1, got {self.crossover_probability:g}"
            )
        for name in ("crossover_index", "mutation_index"):
            if not 0 <= getattr(self, name) < math.inf:
                raise MethodError(f"{name} must be at least 0 and finite, got {getattr(self, name):g}")

    def init(self, seed: int) -> GeneticState:
        """Return the state with a random population."""
        positions = self._scatter(self._random(seed, 0))
        return self._start(
            GeneticState,
            seed,
            positions,
            parents=positions,
            parents_fitness=np.full(self.population, np.inf),
        )

    def _move(self, state: GeneticState, fitness: Array) -> GeneticState:
        joint_fitness = np.concatenate((state.parents_fitness, fitness))
        best = np.argsort(joint_fitness, kind="stable")[: self.population]
        parents = np.concatenate((state.parents, state.positions))[best]
        rng = self._random(state.seed, state.iteration)
        children = self._cross(parents[_tournament(rng, self.population)], rng)[: self.population]
        self._mutate(children, rng)
        return replace(
            state,
            positions=np.clip(children, self.lower, self.upper),
            parents=parents,
            parents_fitness=joint_fitness[best],
        )

    def _cross(self, mates: Array, rng: np.random.Generator) -> Array:
        """Return the children of `mates`, shape (2, m, d), as shape (2 m, d)."""
        _, m, d = mates.shape
        low, high = np.minimum(*mates), np.maximum(*mates)
        dice = rng.random((3, m, d))
        crossed = (rng.random((m, 1)) < self.crossover_probability) & (dice[0] < 0.5)
        crossed &= high - low > NEAREST * (self.upper - self.lower)
        spread = np.where(crossed, high - low, 1.0)
        power = self.crossover_index + 1
        # alpha / 2 is the probability that the spread factor does not exceed the largest within the box.
        alpha = 2 - (1 + 2 * np.stack((low - self.lower, self.upper - high)) / spread) ** -power
        chance = alpha * dice[1]
        beta = np.where(chance <= 1, chance, 1 / (2 - chance)) ** (1 / power)
        reach = (beta * spread - (high - low)) / 2
        first, second = low - reach[0], high + reach[1]
        swapped = dice[2] < 0.5
        children = np.stack((np.where(swapped, second, first), np.where(swapped, first, second)))
        return np.where(crossed, children, mates).reshape(2 * m, d)

    def _mutate(self, children: Array, rng: np.random.Generator) -> None:
        """Mutate `children`, shape (n, d), in place."""
        chosen = np.nonzero(rng.random(children.shape) < 1 / self.lower.size)
        genes, lower, upper = children[chosen], self.lower[chosen[1]], self.upper[chosen[1]]
        chance = rng.random(genes.size)
        down, tail = chance < 0.5, 2 * np.minimum(chance, 1 - chance)
        room = np.where(down, genes - lower, upper - genes) / (upper - lower)
        power = self.mutation_index + 1
        delta = 1 - (tail + (1 - tail) * (1 - room) ** power) ** (1 / power)
        children[chosen] = genes + np.where(down, -delta, delta) * (upper - lower)


def _tournament(rng: np.random.Generator, n: int) -> NDArray[np.intp]:
    """Return `n` winners (n + 1 if `n` is odd) as two rows of mates; the lower index of two wins."""
    entrants = np.concatenate((rng.permutation(n), rng.permutation(n)))
    winners = entrants.reshape(n, 2).min(axis=1)
    return np.resize(winners, (2, (n + 1) // 2))
