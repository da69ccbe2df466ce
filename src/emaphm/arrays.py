"""Types of arrays, root mean square, and intervals of rows as flags."""

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
"""Double precision, any shape; a docstring gives the shape and the unit."""

Single: TypeAlias = NDArray[np.float32]
"""Single precision, any shape; a docstring gives the shape and the unit."""

Flags: TypeAlias = NDArray[np.bool_]
"""True or False, any shape; a docstring gives the shape."""


def floats(values: ArrayLike) -> Array:
    """Return a copy of `values` in double precision: timedelta64 in seconds, masked values as NaN.

    Raises
    ------
    TypeError
        The values are dates, complex or not numeric; the message names the kind and the remedy.
    """
    try:
        given = np.asanyarray(values)
        kind = given.dtype.kind
        if kind not in "cM":
            numbers = given / np.timedelta64(1, "s") if kind == "m" else given
            return np.array(np.ma.filled(numbers.astype(np.float64), np.nan))
    except (TypeError, ValueError):
        raise TypeError("not numeric; give one number a row") from None
    if kind == "M":
        raise TypeError("of dates; give seconds, such as (t - t[0]) / np.timedelta64(1, 's')")
    raise TypeError("complex; give real numbers")


def rms(values: Array) -> float:
    """Return the root mean square of `values` (any shape), without underflow or overflow of the squares."""
    peak = float(np.max(np.abs(values)))
    return peak * float(np.sqrt(np.mean((values / peak) ** 2))) if peak > 0 else 0.0


def runs(true: Flags) -> list[tuple[int, int]]:
    """Return the first row, and the row after the last, of each run of True in an array (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], true, [False])).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def within(starts: NDArray[np.intp], stops: NDArray[np.intp], rows: int) -> Flags:
    """Return whether each of `rows` rows lies in an interval from a start to the row before its stop.

    The intervals (n,) may overlap.
    """
    marks = np.zeros(rows + 1)
    np.add.at(marks, starts, 1)
    np.add.at(marks, stops, -1)
    return np.cumsum(marks[:-1]) > 0
