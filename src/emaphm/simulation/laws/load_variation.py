"""A load that varies over a run: a cubic spline in time, its coefficients at even intervals."""

import math
from typing import Any

import numpy as np

from emaphm.arrays import Array

PREFIX = "load_variation_"
"""What the name of a coefficient begins with; its number follows, from 1 on."""

MORE_THAN_INTERVALS = 3
"""Coefficients of a spline beyond the number of its intervals."""

SPACING_S = 1 / 16
"""Usual interval [s]: such a spline follows what varies more slowly than some 5 Hz."""

FEWEST, MOST = 4, 32
"""Intervals, powers of 2: each number has kernels of its own."""


def coefficient_names(count: int) -> tuple[str, ...]:
    """Return the names of a spline's coefficients."""
    return tuple(f"{PREFIX}{i + 1}" for i in range(count))


def coefficients_for(duration: float) -> int:
    """Return how many coefficients the load of a run of `duration` [s] has."""
    intervals: int = 2 ** round(math.log2(max(duration / SPACING_S, FEWEST)))
    return min(intervals, MOST) + MORE_THAN_INTERVALS


def spline_weights(along: Any) -> tuple[Any, Any, Any, Any]:
    """Return the weights of the four coefficients that a cubic spline of even intervals has at a place.

        (1 - t)³ / 6,  (3 t³ - 6 t² + 4) / 6,  (-3 t³ + 3 t² + 3 t + 1) / 6,  t³ / 6

    Parameters
    ----------
    along : t, how far along its interval the place is, in [0, 1]

    Returns
    -------
    Weights of the coefficients j to j + 3 in interval j, from 0 on; their sum is 1.

    References
    ----------
    [1] C. de Boor, A Practical Guide to Splines, Springer, 2001, chapter IX: B-splines of even knots.
    """
    left = 1.0 - along
    square, cube = along * along, along * along * along
    return (
        left * left * left / 6.0,
        (3.0 * cube - 6.0 * square + 4.0) / 6.0,
        (-3.0 * cube + 3.0 * square + 3.0 * along + 1.0) / 6.0,
        cube / 6.0,
    )


def spline_basis(count: int, shares: Array) -> Array:
    """Return what each of `count` coefficients adds to the load at `shares` (n,) of a run: (n, count)."""
    intervals = count - MORE_THAN_INTERVALS
    places = shares * intervals
    first = np.minimum(places.astype(int), intervals - 1)
    basis = np.zeros((shares.size, count))
    rows = np.arange(shares.size)
    for i, weights in enumerate(spline_weights(places - first)):
        basis[rows, first + i] = weights
    return basis
