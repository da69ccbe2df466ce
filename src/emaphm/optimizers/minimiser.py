"""Common interface of all optimisers: settings, and one call that searches for the least fitness."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.optimizers.box import checked_box


@dataclass(frozen=True, eq=False)
class BestSoFar:
    """State of a search between two populations, for a callback.

    `evaluations` is the number of evaluated points; `best_point`, shape (d,), is the best point and
    `best_fitness` its fitness (inf, and any point of the box, before the first finite value).
    """

    evaluations: int
    best_point: Array
    best_fitness: float


@dataclass(frozen=True, eq=False)
class Result:
    """Result of a search: its best `point`, shape (d,), and the `fitness` of this point.

    `evaluations` is the number of evaluated points; `history`, shape (populations,), is the best fitness
    after each population.
    """

    point: Array
    fitness: float
    evaluations: int
    history: Array


Fitness: TypeAlias = Callable[[Array], ArrayLike]
"""Function of points (n, d) that returns values (n,) in one call; lower is better, and NaN counts as inf."""

OnPopulation: TypeAlias = Callable[[BestSoFar], None]
"""Function that is called after each population."""


@dataclass(frozen=True, eq=False)
class Minimiser(ABC):
    """Settings of a search for the least fitness in the box between `lower` and `upper`, shape (d,) each.

    The defaults are the budget of the thesis (6.7). A subclass may need a larger `least_population`.

    Raises
    ------
    MethodError
        A lower bound is not less than its upper bound, a bound is not finite, the shapes differ, the
        population is below `least_population`, the iterations are below 1, or population or iterations is
        not a whole number.
    """

    least_population: ClassVar[int] = 2

    lower: Array
    upper: Array
    population: int = 50
    iterations: int = 200

    def __post_init__(self) -> None:
        lower, upper = checked_box(self.lower, self.upper)
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)
        for name, least in (("population", self.least_population), ("iterations", 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | np.integer):
                raise MethodError(f"{name} must be a whole number, got {value!r}")
            if value < least:
                raise MethodError(f"{name} must be at least {least}, got {value}")

    @property
    def budget(self) -> int:
        """Largest number of points that a search evaluates."""
        return self.population * self.iterations

    def prepare(self) -> None:  # noqa: B027 - most optimisers need no preparation
        """Import and compile the code of a search, so that the first search takes no longer than the next.

        The results of searches do not change.
        """

    @abstractmethod
    def minimise(self, fitness: Fitness, seed: int, on_population: OnPopulation | None = None) -> Result:
        """Return the best point of a search that evaluates at most `budget` points.

        The same seed gives the same search. An exception of `fitness` or `on_population` ends the search and
        reaches the caller unchanged.

        Raises
        ------
        MethodError
            The number of values of the fitness differs from the number of points.
        SignalError
            The seed is negative.
        """


def checked_fitness(values: ArrayLike, n: int) -> Array:
    """Return the fitness of `n` points, NaN replaced by inf; raise `MethodError` unless its shape is (n,)."""
    fitness = np.asarray(values, float)
    if fitness.shape != (n,):
        raise MethodError(f"fitness has shape {fitness.shape}, expected ({n},): one value for each point")
    return np.where(np.isnan(fitness), np.inf, fitness)
