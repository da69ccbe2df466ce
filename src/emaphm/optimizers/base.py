"""Base of this package's optimisers: frozen settings, a frozen state, and the steps ask and tell.

The caller may store the state, so that a search can be stopped, saved, resumed and compared::

    state = optimizer.init(seed)
    while not optimizer.finished(state):
        state = optimizer.tell(state, fitness(optimizer.ask(state)))
"""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from emaphm.arrays import Array
from emaphm.optimizers.box import from_unit
from emaphm.optimizers.minimiser import (
    BestSoFar,
    Fitness,
    Minimiser,
    OnPopulation,
    Result,
    checked_fitness,
)
from emaphm.random_streams import stream


@dataclass(frozen=True, eq=False)
class State:
    """State of a search; may be pickled between any two steps.

    `positions`, shape (n, d), are the points to evaluate next; `best_point`, shape (d,), is the best
    evaluated point and `best_fitness` its fitness (inf, and any start point, before the first finite value);
    `iteration` counts the evaluated populations, `evaluations` their points. The random numbers of an
    iteration depend only on `seed` and `iteration`, so that no generator needs to be saved.
    """

    seed: int
    iteration: int
    evaluations: int
    positions: Array
    best_point: Array
    best_fitness: float


S = TypeVar("S", bound=State)


@dataclass(frozen=True, eq=False)
class Optimizer(Minimiser, Generic[S]):
    """Search in `iterations` steps, each of which evaluates `population` points; see `Minimiser`.

    A subclass defines `init` and `_move`, and draws all random numbers from `_random`.
    """

    @abstractmethod
    def init(self, seed: int) -> S:
        """Return the state before the first evaluation; raise `SignalError` for a negative seed."""

    @abstractmethod
    def _move(self, state: S, fitness: Array) -> S:
        """Return `state` with new positions; its iteration and best already include `fitness`, shape (n,)."""

    def finished(self, state: S) -> bool:
        """Return whether the search has ended."""
        return state.iteration >= self.iterations

    def ask(self, state: S) -> Array:
        """Return the points to evaluate, shape (n, d): a copy that the caller may change."""
        return state.positions.copy()

    def tell(self, state: S, fitness: ArrayLike) -> S:
        """Return the state after `fitness`, shape (n,), of the points of `ask`; NaN counts as inf.

        Raises
        ------
        MethodError
            `fitness` has another shape.
        """
        n = len(state.positions)
        values = checked_fitness(fitness, n)
        state = replace(state, iteration=state.iteration + 1, evaluations=state.evaluations + n)
        best = int(np.argmin(values))
        if values[best] < state.best_fitness:
            state = replace(state, best_point=state.positions[best], best_fitness=float(values[best]))
        return self._move(state, values)

    def minimise(self, fitness: Fitness, seed: int, on_population: OnPopulation | None = None) -> Result:
        """Run the search to its end; see `Minimiser.minimise`."""
        state = self.init(seed)
        history = []
        while not self.finished(state):
            state = self.tell(state, fitness(self.ask(state)))
            history.append(state.best_fitness)
            if on_population is not None:
                on_population(BestSoFar(state.evaluations, state.best_point, state.best_fitness))
        return Result(state.best_point, state.best_fitness, state.evaluations, np.array(history))

    def _start(self, kind: type[S], seed: int, positions: Array, **more: Any) -> S:
        """Return a state before the first evaluation; `more` are the fields that `kind` adds to `State`."""
        return kind(
            seed=seed,
            iteration=0,
            evaluations=0,
            positions=positions,
            best_point=positions[0],
            best_fitness=np.inf,
            **more,
        )

    def _scatter(self, rng: np.random.Generator) -> Array:
        """Return points drawn uniformly from the box, shape (n, d)."""
        unit = rng.random((self.population, self.lower.size))
        return from_unit(unit, self.lower, self.upper)

    @staticmethod
    def _random(seed: int, iteration: int) -> np.random.Generator:
        """Return the generator of one iteration, 0 for `init`; raise `SignalError` for a negative seed."""
        return stream(seed, "optimizer", iteration)
