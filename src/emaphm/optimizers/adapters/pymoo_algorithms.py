"""Algorithms of pymoo for one objective that search a box and are repeatable from a seed."""

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
"""Points of a trial in addition to two populations. DIRECT and pattern search, which pymoo 0.6 does not seed,
differ between two runs within 80 points."""


@dataclass(frozen=True, eq=False)
class Pymoo(Minimiser):
    """Algorithm of pymoo for one objective [1], with pymoo's defaults; it ends at the budget.

    Parameters
    ----------
    lower, upper, iterations
        As in `Minimiser`.
    population
        Size of the population; algorithms without this setting, such as Nelder-Mead, have their own.
    algorithm
        A name of `pymoo_algorithms`, e.g. ``"ga"`` or ``"nelder-mead"``.

    Raises
    ------
    MethodError
        As in `Minimiser`; or pymoo is not installed or has no such algorithm, or the algorithm fails with
        these settings, does not search real numbers, or is not repeatable from a seed.

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
        own_seed = max(1, child_seed(seed, "optimizer"))  # some algorithms replace 0 by the time of day
        with LibraryFitness(self, fitness, on_population) as evaluate:
            _run(self.algorithm, evaluate, self.lower.size, self.population, self.budget, own_seed)
        return evaluate.result()


def check_algorithm(algorithm: str) -> None:
    """Raise `MethodError` if pymoo is not installed or has no algorithm of this name."""
    import_library(f"method '{PREFIX}{algorithm}'", "pymoo", "peers")
    known = pymoo_algorithms()
    if algorithm not in known:
        hint = nearest(PREFIX + algorithm, [PREFIX + name for name in known])
        raise MethodError(f"unknown method '{PREFIX + algorithm}'{hint}")


@cache
def pymoo_algorithms() -> dict[str, Any]:
    """Return pymoo's classes for one objective by name: `NelderMead` is ``"nelder-mead"``."""
    base = import_module("pymoo.core.algorithm").Algorithm
    classes = {}
    for entry in pkgutil.iter_modules(import_module(PACKAGE).__path__, f"{PACKAGE}."):
        try:
            module = import_module(entry.name)
        except Exception:  # noqa: BLE001, S112 - pymoo raises this if an algorithm needs another library
            continue
        for name, kind in vars(module).items():
            if isinstance(kind, type) and issubclass(kind, base) and kind.__module__ == entry.name:
                classes[re.sub("(?<=[a-z])(?=[A-Z])", "-", name).lower()] = kind
    return classes


@cache
def _flaw(algorithm: str, dimensions: int, population: int) -> str | None:
    """Return the reason why an algorithm cannot be used, from two trials; None if it can be used."""
    # At least two dimensions: with one, two different searches may agree for too long.
    settings = algorithm, max(dimensions, 2), population
    try:
        first, second = _trial(*settings), _trial(*settings)
    except Exception as error:  # noqa: BLE001 - the algorithm cannot be used, whatever pymoo raises
        return f"with population {population} pymoo says '{' '.join(str(error).split())}'"
    if any(points.dtype.kind != "f" for points in first):
        return "it does not search real numbers"
    if len(first) != len(second) or not all(map(np.array_equal, first, second)):
        return "pymoo's search is not repeatable from a seed"
    return None


class _TrialOverError(BaseException):
    """Ends a trial."""


def _trial(algorithm: str, dimensions: int, population: int) -> list[NDArray[Any]]:
    """Return the populations of the first steps of a search on a sphere function."""
    populations: list[NDArray[Any]] = []
    budget = TRIAL_POINTS + 2 * population

    def sphere(points: NDArray[Any]) -> Array:
        populations.append(points.copy())
        if sum(map(len, populations)) > budget:
            raise _TrialOverError
        return np.asarray(np.sum((points - 0.3) ** 2, axis=1))

    with suppress(_TrialOverError):
        _run(algorithm, sphere, dimensions, population, budget, seed=1)
    return populations


def _run(
    algorithm: str,
    fitness: Callable[[Array], Array],
    dimensions: int,
    population: int,
    budget: int,
    seed: int,
) -> None:
    """Run pymoo on `fitness` in the unit cube."""
    generator = _GlobalGenerator(seed)

    def evaluate(points: Array, out: dict[str, Array]) -> None:
        with generator.of_caller():
            out["F"] = fitness(points)

    problem = import_module("pymoo.core.problem").Problem(n_var=dimensions, xl=0.0, xu=1.0)
    problem._evaluate = evaluate  # noqa: SLF001 - pymoo's users define this method
    with generator.of_search():
        search = pymoo_algorithms()[algorithm](pop_size=population)
        search.setup(problem, termination=("n_eval", budget), seed=seed)
        search.run()


class _GlobalGenerator:
    """NumPy's global generator, which some algorithms of pymoo seed and use.

    Its state is that of the search while pymoo runs, and that of the caller in the fitness and after the
    search. One search at a time uses it, so that searches in several threads do not affect each other.
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
    def of_caller(self) -> Iterator[None]:
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
