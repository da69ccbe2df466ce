"""Load that varies over a run: a cubic B-spline in time with even intervals."""

import math
from typing import Any

import numpy as np

from emaphm.arrays import Array

PREFIX = "load_variation_"
"""Prefix of the name of a coefficient; the number of the coefficient follows, from 1."""

MORE_THAN_INTERVALS = 3
"""Number of coefficients of a spline less the number of its intervals."""

SPACING_S = 1 / 16
"""Usual interval [s]: the spline follows variations below about 5 Hz."""

FEWEST, MOST = 4, 32
"""Limits of the number of intervals, a power of 2: each number needs a compiled kernel."""


def coefficient_names(count: int) -> tuple[str, ...]:
    """Return the names of the `count` coefficients of a spline."""
    return tuple(f"{PREFIX}{i + 1}" for i in range(count))


def coefficients_for(duration: float) -> int:
    """Return the number of coefficients for the load of a run of `duration` [s]."""
    intervals: int = 2 ** round(math.log2(max(duration / SPACING_S, FEWEST)))
    return min(intervals, MOST) + MORE_THAN_INTERVALS


def spline_weights(along: Any) -> tuple[Any, Any, Any, Any]:
    """Return the weights of the four coefficients of a cubic B-spline with even intervals at a point.

        (1 - t)³ / 6,  (3 t³ - 6 t² + 4) / 6,  (-3 t³ + 3 t² + 3 t + 1) / 6,  t³ / 6

    Parameters
    ----------
    along : t, position of the point in its interval, relative to the interval's length, in [0, 1] [-]

    Returns
    -------
    Weights of the coefficients j to j + 3 in interval j, with j counted from 0; their sum is 1.

    References
    ----------
    [1] C. de Boor, A Practical Guide to Splines, Springer, 2001, chapter IX: B-splines of even knots.
    """
    complement = 1.0 - along
    square, cube = along * along, along * along * along
    return (
        complement * complement * complement / 6.0,
        (3.0 * cube - 6.0 * square + 4.0) / 6.0,
        (-3.0 * cube + 3.0 * square + 3.0 * along + 1.0) / 6.0,
        cube / 6.0,
    )


def spline_basis(count: int, shares: Array) -> Array:
    """Return the weight of each of `count` coefficients at the times `shares` (n,), (n, count).

    `shares` are times relative to the duration of the run, in [0, 1].
    """
    intervals = count - MORE_THAN_INTERVALS
    places = shares * intervals
    first = np.minimum(places.astype(int), intervals - 1)
    basis = np.zeros((shares.size, count))
    rows = np.arange(shares.size)
    for i, weights in enumerate(spline_weights(places - first)):
        basis[rows, first + i] = weights
    return basis
