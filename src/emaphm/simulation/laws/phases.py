"""A quantity of the three phases: operators and functions act on each phase."""

from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any, Self

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from emaphm.arrays import Array

NAMES = ("a", "b", "c")


class Phases(NDArrayOperatorsMixin):
    """A quantity of the phases a, b and c: three scalars of a kernel, numbers or NumPy arrays.

    Operators and NumPy's functions are evaluated phase by phase; an operand that is no `Phases` is used in
    each phase.
    """

    def __init__(self, a: Any, b: Any, c: Any) -> None:
        self.a, self.b, self.c = a, b, c

    @classmethod
    def of(cls, values: Any, name: str) -> Self:
        """Return `name`_a, `name`_b and `name`_c of a named tuple."""
        return cls(*(getattr(values, field) for field in phase_names(name)))

    def sum(self) -> Any:
        """Return a + b + c."""
        return self.a + self.b + self.c

    def of_pairs(self) -> Self:
        """Return for each phase the sum of the two other phases, which conduct while it idles."""
        return type(self)(self.b + self.c, self.c + self.a, self.a + self.b)

    def __iter__(self) -> Iterator[Any]:
        """Iterate over a, b and c."""
        return iter((self.a, self.b, self.c))

    def __array_ufunc__(self, ufunc: Any, method: str, *operands: Any, **options: Any) -> Any:
        """Return NumPy's `ufunc` of each phase."""
        return NotImplemented if method != "__call__" or options else _by_each_phase(ufunc, operands)

    def __array_function__(self, function: Any, _types: Any, operands: Any, options: Any) -> Any:
        """Return NumPy's `where` of each phase."""
        return NotImplemented if function is not np.where or options else _by_each_phase(function, operands)


@cache
def phase_names(name: str) -> tuple[str, ...]:
    """Return `name`_a, `name`_b and `name`_c."""
    return tuple(f"{name}_{phase}" for phase in NAMES)


def by_phase(name: str, rows: Iterable[Array]) -> dict[str, Array]:
    """Return the rows of an array (3, n), or of `Phases` of (n,), as `name`_a, `name`_b and `name`_c."""
    return dict(zip(phase_names(name), rows, strict=True))


def _by_each_phase(function: Any, operands: Any) -> Phases:
    by_operand = (x if isinstance(x, Phases) else (x, x, x) for x in operands)
    return Phases(*(function(*of_phase) for of_phase in zip(*by_operand, strict=True)))
