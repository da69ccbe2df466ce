"""Every algorithm of pymoo for one objective that can search a box and repeats itself from a seed."""

import pkgutil
import re
import threading
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.errors import MethodError, nearest
from emaphm.optimizers.adapters.driven import Driven, Evaluate, library

PREFIX = "pymoo-"

PACKAGE = "pymoo.algorithms.soo.nonconvex"

TRIAL_POINTS = 200
"""Points of a trial, beside two populations. DIRECT and pattern search, whose numbers pymoo 0.6 draws from
no seed, part from themselves within 80."""


@dataclass(frozen=True, eq=False)
class Pymoo(Driven):
    """An algorithm of pymoo for one objective [1], with pymoo's defaults but for its end, the budget.

    Parameters
    ----------
    lower, upper, iterations
        As in `Optimizer`.
    population
        Algorithms without a size of the population to set, such as Nelder and Mead's, keep their own.
    algorithm
        A name of `pymoo_algorithms`, e.g. ``"ga"`` or ``"nelder-mead"``.

    Raises
    ------
    MethodError
        As in `Driven`; or pymoo has no such algorithm, or this one cannot work with these settings, or
        searches other things than real numbers, or does not repeat its search from a seed.

    References
    ----------
    .. [1] J. Blank, K. Deb, "pymoo: multi-objective optimization in Python", IEEE Access 8, 2020.
    """

    algorithm: str = field(kw_only=True)

    @property
    def method(self) -> str:
        """Name on the command line."""
        return PREFIX + self.algorithm

    def __post_init__(self) -> None:
        super().__post_init__()
        check_algorithm(self.algorithm)
        flaw = _flaw(self.algorithm, self.lower.size, self.population)
        if flaw is not None:
            raise MethodError(f"method '{self.method}' cannot be used: {flaw}; choose another")

    def _drive(self, evaluate: Evaluate, rng: np.random.Generator) -> None:
        library(self.method, "pymoo")
        seed = int(rng.integers(1, 2**31))  # 0 is the time of day to some
        _minimise(self.algorithm, evaluate, self.lower.size, self.population, self.budget, seed)


def check_algorithm(algorithm: str) -> None:
    """Refuse, by `MethodError`, a name that is none of pymoo's algorithms, and any if pymoo is missing."""
    library(PREFIX + algorithm, "pymoo")
    known = pymoo_algorithms()
    if algorithm not in known:
        hint = nearest(PREFIX + algorithm, [PREFIX + name for name in known])
        raise MethodError(f"unknown method '{PREFIX + algorithm}'{hint}")


@cache
def pymoo_algorithms() -> dict[str, Any]:
    """Return pymoo's classes for one objective by name: `NelderMead` is ``"nelder-mead"``."""
    base = import_module("pymoo.core.algorithm").Algorithm
    found = {}
    for entry in pkgutil.iter_modules(import_module(PACKAGE).__path__, f"{PACKAGE}."):
        try:
            module = import_module(entry.name)
        except Exception:  # noqa: BLE001, S112 - pymoo's way to say that an algorithm needs another library
            continue
        for name, kind in vars(module).items():
            if isinstance(kind, type) and issubclass(kind, base) and kind.__module__ == entry.name:
                found[re.sub("(?<=[a-z])(?=[A-Z])", "-", name).lower()] = kind
    return found


def usable_algorithms() -> tuple[str, ...]:
    """Return the names of the algorithms that pass a trial; takes seconds when first called."""
    return tuple(name for name in pymoo_algorithms() if _flaw(name, 8, 50) is None)


@cache
def _flaw(algorithm: str, dimensions: int, population: int) -> str | None:
    """Return what keeps an algorithm from use, found by trying; None if nothing does."""
    # Two dimensions at least: with one, chance may show too late.
    settings = algorithm, max(dimensions, 2), population
    try:
        first, second = _trial(*settings), _trial(*settings)
    except Exception as error:  # noqa: BLE001 - whatever pymoo raises, it cannot be used
        return f"with population {population} pymoo says '{' '.join(str(error).split())}'"
    if any(points.dtype.kind != "f" for points in first):
        return "it does not search real numbers"
    if len(first) != len(second) or not all(map(np.array_equal, first, second)):
        return "pymoo does not repeat its search from a seed"
    return None


class _TrialOverError(BaseException):
    """Ends a trial."""


def _trial(algorithm: str, dimensions: int, population: int) -> list[NDArray[Any]]:
    """Return the populations of the first steps on a sphere."""
    asked: list[NDArray[Any]] = []
    budget = TRIAL_POINTS + 2 * population

    def sphere(points: NDArray[Any]) -> Array:
        asked.append(points.copy())
        if sum(map(len, asked)) > budget:
            raise _TrialOverError
        return np.asarray(np.sum((points - 0.3) ** 2, axis=1))

    with suppress(_TrialOverError):
        _minimise(algorithm, sphere, dimensions, population, budget, seed=1)
    return asked


def _minimise(
    algorithm: str, evaluate: Evaluate, dimensions: int, population: int, budget: int, seed: int
) -> None:
    numbers = _GlobalNumbers(seed)

    def fitness(points: Array) -> Array:
        numbers.give_back()
        values = evaluate(points)
        numbers.take()  # not after an exception, which ends the search
        return values

    problem = import_module("pymoo.core.problem").Problem(n_var=dimensions, xl=0.0, xu=1.0)
    # The method that pymoo leaves to its users to define.
    problem._evaluate = lambda points, out: out.update(F=fitness(points))  # noqa: SLF001
    numbers.take()
    try:
        search = pymoo_algorithms()[algorithm](pop_size=population)
        search.setup(problem, termination=("n_eval", budget), seed=seed)
        search.run()
    finally:
        numbers.give_back()


class _GlobalNumbers:
    """Numpy's global generator, lent to pymoo while it runs and put back whenever it halts.

    Some of its algorithms seed and draw from it. One may have it at a time, so that searches do not
    disturb each other; while one has it, other threads should not use it.
    """

    _only_one = threading.Lock()

    def __init__(self, seed: int) -> None:
        self._ours: Any = np.random.RandomState(seed).get_state()
        self._lent = False

    def take(self) -> None:
        self._only_one.acquire()
        self._lent = True
        self._callers = np.random.get_state()  # noqa: NPY002
        np.random.set_state(self._ours)  # noqa: NPY002

    def give_back(self) -> None:
        if not self._lent:
            return
        self._ours = np.random.get_state()  # noqa: NPY002
        np.random.set_state(self._callers)  # noqa: NPY002
        self._lent = False
        self._only_one.release()
