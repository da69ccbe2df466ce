"""A library's loop, which calls the fitness itself, turned into steps between frozen states."""

import copy
import threading
import weakref
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from importlib import import_module
from queue import SimpleQueue
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.optimizers.base import Optimizer, State, from_unit, generator

Evaluate: TypeAlias = Callable[[Array], Array]

FAR = 1e100
"""What a library is told for inf, and for all beyond; squared and summed it stays finite."""

ROUNDING = 1e-9
"""How far, in widths of the box, a library's own scaling may carry a point past a bound."""


@dataclass(frozen=True, eq=False)
class DrivenState(State):
    """State of a library's search: `told`, shape (evaluations,), is all the fitness it was given, in order.

    With the seed, that is enough to lead the library to the same place again.
    """

    told: Array


class Driven(Optimizer[DrivenState]):
    """Base of the optimisers of other libraries; a subclass sets `method` and defines `_drive`.

    The library runs in a thread of its own, halted wherever it asks for fitness, one such search for each
    newest state of a run. They are kept beside the states, not in them: a search ends, and its thread with
    it, when its state or its optimiser is given up. A state without a search of its own, older, unpickled
    or told twice, is led to its place again from the seed and the fitness recorded.

    A run has finished when the library ends it or `budget` points are evaluated, never more: the last
    population is cut to what is left. Populations may differ in size, and so may their number from
    `iterations`. Errors of the library are raised by `init` and `tell`.

    Raises
    ------
    MethodError
        As in `Optimizer`; or the library is not installed, or cannot work with so small a population.
    """

    least_population: ClassVar[int] = 2

    @property
    @abstractmethod
    def method(self) -> str:
        """Name on the command line."""

    @abstractmethod
    def _drive(self, evaluate: Evaluate, rng: np.random.Generator) -> None:
        """Run the library in the unit cube, all its chance from `rng`; `evaluate` maps (m, d) to (m,)."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.population < self.least_population:
            raise MethodError(
                f"population must be at least {self.least_population} for '{self.method}', "
                f"got {self.population}"
            )

    def __getstate__(self) -> dict[str, Any]:
        """Return the settings alone: threads cannot be copied or saved."""
        return {name: value for name, value in self.__dict__.items() if name != "_live"}

    @cached_property
    def _live(self) -> weakref.WeakKeyDictionary[DrivenState, "_Search"]:
        """The searches that stand where a state is, each to be used once."""
        return weakref.WeakKeyDictionary()

    def init(self, seed: int) -> DrivenState:
        """Return the state with the library's first population."""
        middle = (self.lower + self.upper) / 2
        nothing = np.empty(0)
        state = DrivenState(seed, 0, 0, np.empty((0, middle.size)), middle, np.inf, nothing)
        return self._asked(self._search(seed), state)

    def finished(self, state: DrivenState) -> bool:
        """Return whether the library has ended the search or the budget is spent."""
        return not len(state.positions)

    def tell(self, state: DrivenState, fitness: ArrayLike) -> DrivenState:
        """Return the state that follows, as `Optimizer.tell`; `MethodError` also if the run has finished."""
        if self.finished(state):
            raise MethodError(f"'{self.method}' has finished after {state.evaluations} evaluations")
        told = super().tell(state, fitness)
        search = self._live.pop(state, None)
        if told.evaluations >= self.budget:
            if search is not None:
                search.end()
            return replace(told, positions=told.positions[:0])
        if search is None or not search.alive:
            search = self._led_back(state)
        search.answer(told.told[state.evaluations :])
        return self._asked(search, told)

    def _move(self, state: DrivenState, fitness: Array) -> DrivenState:
        return replace(state, told=np.concatenate((state.told, fitness)))

    def _asked(self, search: "_Search", state: DrivenState) -> DrivenState:
        """Return `state` with the points that `search` asks for; none if it has ended."""
        points = search.ask()
        left = self.budget - state.evaluations
        state = replace(state, positions=points[:left].reshape(-1, self.lower.size))
        if len(points):
            self._live[state] = search
        return state

    def _search(self, seed: int) -> "_Search":
        # A thread that held this very object would keep the object's searches alive, and so itself.
        return _Search(partial(copy.copy(self)._begin, generator(seed, 0)))  # noqa: SLF001 - a copy of self

    def _begin(self, rng: np.random.Generator, ask: Evaluate) -> None:
        self._drive(partial(self._evaluate, ask), rng)

    def _evaluate(self, ask: Evaluate, points: ArrayLike) -> Array:
        unit = np.array(points, float)
        if not len(unit):
            return np.empty(0)
        if not np.all(np.abs(unit - 0.5) <= 0.5 + ROUNDING):  # also refuses NaN
            raise MethodError("the library asked for points outside the bounds; choose another method")
        return np.clip(ask(from_unit(unit, self.lower, self.upper)), -FAR, FAR)

    def _led_back(self, state: DrivenState) -> "_Search":
        """Return a new search that stands where `state` is."""
        search = self._search(state.seed)
        points, n = search.ask(), 0
        while len(points) and n + len(points) <= state.evaluations:
            search.answer(state.told[n : n + len(points)])
            n += len(points)
            points = search.ask()
        if not np.array_equal(points[: self.budget - n], state.positions):
            raise MethodError(
                f"'{self.method}' does not come to this state again: "
                "use the settings and the version of the library that made it"
            )
        return search


class _Search:
    """A library's loop in a thread, halted wherever it asks for fitness.

    The thread knows the two queues but not this object, whose end is therefore the thread's end too: an
    exception is thrown into the library from its call of the fitness.
    """

    def __init__(self, drive: Callable[[Evaluate], None]) -> None:
        self._questions: SimpleQueue[Array | BaseException | None] = SimpleQueue()
        self._answers: SimpleQueue[Array | None] = SimpleQueue()
        self._thread = threading.Thread(
            target=_run, args=(drive, self._questions, self._answers), name="emaphm-search", daemon=True
        )
        # Runs at the latest when the interpreter exits, so that no thread is killed inside a library.
        self._end = weakref.finalize(self, _end, self._thread, self._answers)
        self._thread.start()

    @property
    def alive(self) -> bool:
        """Whether the library waits for an answer; in a forked process its thread is missing."""
        return self._thread.is_alive()

    def ask(self) -> Array:
        """Return the next points, shape (m, d), none after the end; the library's error is raised."""
        question = self._questions.get()
        if isinstance(question, BaseException):
            self.end()
            raise question
        if question is None:
            self.end()
            return np.empty((0, 0))
        return question

    def answer(self, fitness: Array) -> None:
        """Let the library go on with the fitness, shape (m,), of the points asked."""
        self._answers.put(fitness)

    def end(self) -> None:
        """End the library's loop and wait for its thread."""
        self._end()


class _AbandonedError(BaseException):
    """Thrown through a library to end it; no `except Exception` on the way stops it."""


def _run(
    drive: Callable[[Evaluate], None],
    questions: "SimpleQueue[Array | BaseException | None]",
    answers: "SimpleQueue[Array | None]",
) -> None:
    def ask(points: Array) -> Array:
        questions.put(points)
        fitness = answers.get()
        if fitness is None:
            answers.put(None)  # for a library that calls again in spite of the exception
            raise _AbandonedError
        return fitness

    try:
        with np.errstate(all="ignore"):  # what `FAR` makes of a library's own sums is no news to the user
            drive(ask)
    except BaseException as error:  # noqa: BLE001 - raised again in the thread that asks
        questions.put(error)
    else:
        questions.put(None)


def _end(thread: threading.Thread, answers: "SimpleQueue[Array | None]") -> None:
    answers.put(None)
    if thread is not threading.current_thread():  # garbage may be collected in any thread
        thread.join()


def library(method: str, module: str) -> Any:
    """Return a module of a library that need not be installed.

    Raises
    ------
    MethodError
        The library is not installed.
    """
    name = module.partition(".")[0]
    try:
        import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:  # it is there, but something that it needs is not
            raise
        raise MethodError(
            f"method '{method}' needs the library '{name}'; install it with: pip install 'emaphm[peers]'"
        ) from None
    return import_module(module)
