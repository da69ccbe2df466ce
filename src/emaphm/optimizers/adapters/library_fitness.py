"""Fitness for other libraries: a function of points of the unit cube that ends the search at the budget."""

from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.optimizers.box import from_unit
from emaphm.optimizers.minimiser import (
    BestSoFar,
    Fitness,
    Minimiser,
    OnPopulation,
    Result,
    checked_fitness,
)

FAR = 1e100
"""Limit of the fitness that a library receives, also for inf; squares and sums of it are finite."""

ROUNDING = 1e-9
"""Largest distance of a point beyond a bound, by a library's own scaling, in widths of the box."""


class LibraryFitness:
    """Fitness for a library: a function of points (m, d) of the unit cube that returns values (m,).

    The `minimise` of an adapter is::

        with LibraryFitness(self, fitness, on_population) as evaluate:
            library.search(evaluate)
        return evaluate.result()

    The object stores the best point. The last population is cut to the remaining budget. At the end of the
    budget, or if the fitness raises an error, a private exception passes through the library and ends at the
    ``with``, which raises the error of the fitness, if any. Errors of the library leave the ``with``
    unchanged.

    Raises
    ------
    MethodError
        The library evaluates a point outside the bounds; or as in `Minimiser.minimise`.
    """

    def __init__(self, settings: Minimiser, fitness: Fitness, on_population: OnPopulation | None) -> None:
        self._settings, self._fitness, self._on_population = settings, fitness, on_population
        self._best = BestSoFar(0, (settings.lower + settings.upper) / 2, np.inf)
        self._history: list[float] = []
        self._ended = False
        self._error: BaseException | None = None
        self._callers_warnings = np.geterr()
        # NumPy warnings that `FAR` causes in a library's own computations are suppressed.
        self._no_warnings = np.errstate(all="ignore")

    def __enter__(self) -> Self:
        self._no_warnings.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> bool:
        self._no_warnings.__exit__(kind, error, traceback)
        if self._error is not None:
            try:
                raise self._error
            finally:
                self._error = None  # its traceback refers to this object: a reference cycle
        # Some libraries convert one exception into another.
        return self._ended and isinstance(error, Exception | _SearchEndedError)

    def __call__(self, points: ArrayLike) -> Array:
        """Return the fitness of `points` as finite numbers; end the search at the end of the budget."""
        if self._ended:  # the library continued in spite of the exception
            raise _SearchEndedError
        try:
            values = self._evaluate(np.array(points, float))
        except BaseException as error:
            self._ended, self._error = True, error
            raise _SearchEndedError from error
        if self._best.evaluations >= self._settings.budget:
            self._ended = True
            raise _SearchEndedError
        return np.clip(values, -FAR, FAR)

    def result(self) -> Result:
        """Return the best point so far; the middle of the box if no point has a finite fitness."""
        best = self._best
        return Result(best.best_point, best.best_fitness, best.evaluations, np.array(self._history))

    def _evaluate(self, unit: Array) -> Array:
        if not len(unit):
            return np.empty(0)
        if not np.all(np.abs(unit - 0.5) <= 0.5 + ROUNDING):  # also refuses NaN
            raise MethodError("the library evaluated points outside the bounds; choose another method")
        remaining = self._settings.budget - self._best.evaluations
        points = from_unit(unit[:remaining], self._settings.lower, self._settings.upper)
        with np.errstate(**self._callers_warnings):
            values = checked_fitness(self._fitness(points.copy()), len(points))
            self._keep(points, values)
        return values

    def _keep(self, points: Array, values: Array) -> None:
        """Count the points, store the best point and report it."""
        best = int(np.argmin(values))
        point, least = self._best.best_point, self._best.best_fitness
        if values[best] < least:
            point, least = points[best], float(values[best])
        self._best = BestSoFar(self._best.evaluations + len(points), point, least)
        self._history.append(least)
        if self._on_population is not None:
            self._on_population(self._best)


class _SearchEndedError(BaseException):
    """Ends a search of a library; not an `Exception`, so that no ``except Exception`` catches it."""
