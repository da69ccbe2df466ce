"""Every algorithm of pymoo for one objective that searches a box and repeats its search from a seed."""

import pkgutil
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.errors import MethodError, nearest
from emaphm.optimizers.adapters.library_fitness import LibraryFitness
from emaphm.optimizers.minimiser import Fitness, Minimiser, OnPopulation, Result
from emaphm.optional_library import import_library
from emaphm.random_streams import child_seed

PREFIX = "pymoo-"

PACKAGE = "pymoo.algorithms.soo.nonconvex"

TRIAL_POINTS = 200
"""Points of a trial in addition to two populations. DIRECT and pattern search, whose numbers pymoo 0.6 draws
from no seed, differ between two runs within 80 points."""


@dataclass(frozen=True, eq=False)
class Pymoo(Minimiser):
    """An algorithm of pymoo for one objective [1], with pymoo's defaults but for its end, the budget.

    Parameters
    ----------
    lower, upper, iterations
        As in `Minimiser`.
    population
        Algorithms without a size of the population to set, such as Nelder and Mead's, keep their own.
    algorithm
        A name of `pymoo_algorithms`, e.g. ``"ga"`` or ``"nelder-mead"``.

    Raises
    ------
    MethodError
        As in `Minimiser`; or pymoo is not installed or has no such algorithm, or this one cannot work with
        these settings, or searches other things than real numbers, or does not repeat its search from a
        seed.

    References
    ----------
    .. [1] J. Blank, K. Deb, "pymoo: multi-objective optimization in Python", IEEE Access 8, 2020.
    """

    algorithm: str = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_algorithm(self.algorithm)
        flaw = _flaw(self.algorithm, self.lower.size, self.population)
        if flaw is not None:
            raise MethodError(f"method '{PREFIX + self.algorithm}' cannot be used: {flaw}; choose another")

    def minimise(self, fitness: Fitness, seed: int, on_population: OnPopulation | None = None) -> Result:
        """Run pymoo's algorithm; see `Minimiser.minimise`."""
        import_library(f"method '{PREFIX}{self.algorithm}'", "pymoo", "peers")
        own_seed = max(1, child_seed(seed, "optimizer"))  # 0 stands for the time of day in some algorithms
        with LibraryFitness(self, fitness, on_population) as evaluate:
            _run(self.algorithm, evaluate, self.lower.size, self.population, self.budget, own_seed)
        return evaluate.result()


def check_algorithm(algorithm: str) -> None:
    """Refuse, by `MethodError`, a name that is none of pymoo's algorithms, and any if pymoo is missing."""
    import_library(f"method '{PREFIX}{algorithm}'", "pymoo", "peers")
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
        _run(algorithm, sphere, dimensions, population, budget, seed=1)
    return asked


def _run(
    algorithm: str,
    fitness: Callable[[Array], Array],
    dimensions: int,
    population: int,
    budget: int,
    seed: int,
) -> None:
    """Run pymoo on `fitness` in the unit cube."""
    numbers = _GlobalNumbers(seed)

    def evaluate(points: Array, out: dict[str, Array]) -> None:
        with numbers.callers():
            out["F"] = fitness(points)

    problem = import_module("pymoo.core.problem").Problem(n_var=dimensions, xl=0.0, xu=1.0)
    problem._evaluate = evaluate  # noqa: SLF001 - the method that pymoo leaves to its users to define
    with numbers.of_search():
        search = pymoo_algorithms()[algorithm](pop_size=population)
        search.setup(problem, termination=("n_eval", budget), seed=seed)
        search.run()


class _GlobalNumbers:
    """Numpy's global generator, which some algorithms of pymoo seed and draw from.

    It has the search's numbers while pymoo runs, and the caller's in the fitness and after the end. One
    search at a time has it, so that searches in several threads do not disturb each other.
    """

    _only_one = Lock()

    def __init__(self, seed: int) -> None:
        self._other: Any = np.random.RandomState(seed).get_state()

    @contextmanager
    def of_search(self) -> Iterator[None]:
        with self._only_one:
            self._swap()
            try:
                yield
            finally:
                self._swap()

    @contextmanager
    def callers(self) -> Iterator[None]:
        self._swap()
        self._only_one.release()
        try:
            yield
        finally:
            self._only_one.acquire()
            self._swap()

    def _swap(self) -> None:
        present = np.random.get_state()  # noqa: NPY002
        np.random.set_state(self._other)  # noqa: NPY002
        self._other = present
