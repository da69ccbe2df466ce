"""Rows of a given signal as means over the intervals between them."""

from collections.abc import Callable

import numpy as np

from emaphm.arrays import Array

POINTS = 16
"""Number of points from which the mean over a row is computed."""

POINTS_AT_JUMPS = 1024
"""Number of points in a row with a jump: the mean then places the jump to a thousandth of the interval."""

JUMP = 0.5
"""Least step between two points, relative to the range offsets a row, that counts as a jump; a smooth curve
has 1/8 at most."""

ROWS_AT_ONCE = 1000


def signal_rows(signal: Callable[[Array], Array], starts: Array, interval: float) -> Array:
    """Return the means (n,) of `signal`, a function of time [s], over `interval` [s] from `starts` (n,)."""
    middles = (np.arange(POINTS) + 0.5) / POINTS
    points = np.concatenate([[0.0], middles, [1.0]])
    values = _values_at(signal, starts, points * interval)
    means = values[:, 1:-1].mean(axis=1)
    steps = np.abs(np.diff(values, axis=1)).max(axis=1)
    rows_with_jump = np.flatnonzero(steps > JUMP * np.ptp(values, axis=1))
    finer = (np.arange(POINTS_AT_JUMPS) + 0.5) / POINTS_AT_JUMPS
    for first in range(0, rows_with_jump.size, ROWS_AT_ONCE):
        rows = rows_with_jump[first : first + ROWS_AT_ONCE]
        means[rows] = _values_at(signal, starts[rows], finer * interval).mean(axis=1)
    return np.asarray(means)


def _values_at(signal: Callable[[Array], Array], starts: Array, offsets: Array) -> Array:
    """Return `signal` at the times `offsets` (m,) after each of `starts` (n,), shape (n, m)."""
    times = starts[:, np.newaxis] + offsets
    return np.asarray(signal(times.ravel())).reshape(times.shape)
