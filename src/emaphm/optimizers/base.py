"""What every population-based optimiser is: frozen settings, a frozen state, and the steps between states.

The one who holds the state drives the search, so that a run can be stopped, saved, resumed and compared::

    state = optimizer.init(seed)
    while not optimizer.finished(state):
        state = optimizer.tell(state, fitness(optimizer.ask(state)))
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emaphm.errors import MethodError

RANDOM_STREAM = 0x0971
"""Spawn key of the optimisers: keeps their numbers apart from `default_rng(seed)`, used elsewhere."""


@dataclass(frozen=True, eq=False)
class State:
    """All that changes during a run; may be pickled at any moment.

    `positions`, shape (n, d), are the points to evaluate next; `best_point`, shape (d,), is the best
    evaluated so far and `best_fitness` its fitness (inf, and any start point, before the first finite one);
    `iteration` counts the populations evaluated, `evaluations` their points. The random numbers of an
    iteration derive from `seed` and `iteration` alone, so no generator needs to be saved.
    """

    seed: int
    iteration: int
    evaluations: int
    positions: NDArray[np.float64]
    best_point: NDArray[np.float64]
    best_fitness: float


S = TypeVar("S", bound=State)


@dataclass(frozen=True, eq=False)
class Optimizer(ABC, Generic[S]):
    """Settings of a search for the least fitness in the box between `lower` and `upper`, shape (d,) each.

    A subclass defines `init` and `_move`; each of `iterations` steps evaluates `population` points. The
    defaults are the budget of the thesis (6.7).

    Raises
    ------
    MethodError
        A lower bound is not less than its upper bound, a bound is not finite, the shapes differ, the
        population is below 2, the iterations are below 1, or one of these is no whole number.
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    population: int = 50
    iterations: int = 200

    def __post_init__(self) -> None:
        lower, upper = checked_box(self.lower, self.upper)
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)
        for name in ("population", "iterations"):
            if isinstance(getattr(self, name), bool) or not isinstance(getattr(self, name), int | np.integer):
                raise MethodError(f"{name} must be a whole number, got {getattr(self, name)!r}")
        if self.population < 2:
            raise MethodError(f"population must be at least 2, got {self.population}")
        if self.iterations < 1:
            raise MethodError(f"iterations must be at least 1, got {self.iterations}")

    @abstractmethod
    def init(self, seed: int) -> S:
        """Return the state before the first evaluation; `MethodError` for a negative seed."""

    @abstractmethod
    def _move(self, state: S, fitness: NDArray[np.float64]) -> S:
        """Return `state` with new positions; its iteration and best already take in `fitness`, shape (n,)."""

    @property
    def budget(self) -> int:
        """The most points that a whole run evaluates."""
        return self.population * self.iterations

    def finished(self, state: S) -> bool:
        """Return whether the run has come to its end."""
        return state.iteration >= self.iterations

    def ask(self, state: S) -> NDArray[np.float64]:
        """Return the points to evaluate, shape (n, d); a copy, the caller's to change."""
        return state.positions.copy()

    def tell(self, state: S, fitness: ArrayLike) -> S:
        """Return the state that follows from the fitness, shape (n,), of the points asked; NaN counts as inf.

        Raises
        ------
        MethodError
            `fitness` has another shape.
        """
        values, n = np.asarray(fitness, float), len(state.positions)
        if values.shape != (n,):
            raise MethodError(f"fitness has shape {values.shape}, expected ({n},): one value for each point")
        values = np.where(np.isnan(values), np.inf, values)
        state = replace(state, iteration=state.iteration + 1, evaluations=state.evaluations + n)
        best = int(np.argmin(values))
        if values[best] < state.best_fitness:
            state = replace(state, best_point=state.positions[best], best_fitness=float(values[best]))
        return self._move(state, values)

    def _start(self, kind: type[S], seed: int, positions: NDArray[np.float64], **more: Any) -> S:
        """Return the state before anything is evaluated; `more` are the fields of its own kind."""
        return kind(
            seed=seed,
            iteration=0,
            evaluations=0,
            positions=positions,
            best_point=positions[0],
            best_fitness=np.inf,
            **more,
        )

    def _scatter(self, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return points drawn uniformly from the box, shape (n, d)."""
        unit = rng.random((self.population, self.lower.size))
        return from_unit(unit, self.lower, self.upper)


@dataclass(frozen=True, eq=False)
class Result:
    """What a search found: `point`, shape (d,), its `fitness`, and how it got there.

    `evaluations` counts points; `history`, shape (iterations done,), is the best fitness after each.
    """

    point: NDArray[np.float64]
    fitness: float
    evaluations: int
    history: NDArray[np.float64]


def minimise(
    optimizer: Optimizer[S],
    fitness: Callable[[NDArray[np.float64]], ArrayLike],
    seed: int,
    on_iteration: Callable[[S], None] | None = None,
) -> Result:
    """Run `optimizer` to its end on `fitness`, which maps points (n, d) to values (n,) in one call.

    `on_iteration` is called with the state after each iteration. Errors as in `Optimizer.init` and
    `Optimizer.tell`.
    """
    state = optimizer.init(seed)
    history = []
    while not optimizer.finished(state):
        state = optimizer.tell(state, fitness(optimizer.ask(state)))
        history.append(state.best_fitness)
        if on_iteration is not None:
            on_iteration(state)
    return Result(state.best_point, state.best_fitness, state.evaluations, np.array(history))


def generator(seed: int, iteration: int) -> np.random.Generator:
    """Return the random numbers of one iteration; `MethodError` for a negative seed."""
    if seed < 0:
        raise MethodError(f"seed must be at least 0, got {seed}")
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(RANDOM_STREAM, iteration)))


def checked_box(lower: ArrayLike, upper: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return read-only copies of the bounds, (d,) each; `MethodError` unless finite and lower < upper."""
    low, high = np.array(lower, float), np.array(upper, float)
    if low.ndim != 1 or low.shape != high.shape or not low.size:
        raise MethodError(
            f"bounds must be two vectors of one length, got shapes {low.shape} and {high.shape}"
        )
    for i in range(low.size):
        if not low[i] < high[i]:  # also refuses NaN
            raise MethodError(
                f"lower bound ({low[i]:g}) of component {i} must be less than upper bound ({high[i]:g})"
            )
        if not np.isfinite(high[i] - low[i]):
            raise MethodError(f"bounds of component {i} must be finite, got {low[i]:g} and {high[i]:g}")
    low.flags.writeable = False
    high.flags.writeable = False
    return low, high


def from_unit(
    unit: NDArray[np.float64], lower: NDArray[np.float64], upper: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return points (n, d) of the unit cube mapped to the box; clipped, as rounding may step past a bound."""
    return np.clip(lower + (upper - lower) * unit, lower, upper)
