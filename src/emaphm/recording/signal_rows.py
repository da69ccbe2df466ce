"""A given signal as it is recorded in rows that are means over their intervals."""

from collections.abc import Callable

import numpy as np

from emaphm.arrays import Array

POINTS = 16
"""Points that the mean over a row is taken from."""

POINTS_AT_JUMPS = 1024
"""Points in a row in which the signal jumps: its mean places the jump to a thousandth of the interval."""

JUMP = 0.5
"""Share of a row's range within one point's distance from which on it jumps; a curve has 1/8 at most."""

ROWS_AT_ONCE = 1000


def signal_rows(signal: Callable[[Array], Array], starts: Array, interval: float) -> Array:
    """Return the mean of `signal`, a function of time [s], over `interval` [s] from each of `starts` (n,)."""
    middles = (np.arange(POINTS) + 0.5) / POINTS
    within = np.concatenate([[0.0], middles, [1.0]])
    values = _at(signal, starts, within * interval)
    means = values[:, 1:-1].mean(axis=1)
    steps = np.abs(np.diff(values, axis=1)).max(axis=1)
    jumping = np.flatnonzero(steps > JUMP * np.ptp(values, axis=1))
    finer = (np.arange(POINTS_AT_JUMPS) + 0.5) / POINTS_AT_JUMPS
    for first in range(0, jumping.size, ROWS_AT_ONCE):
        rows = jumping[first : first + ROWS_AT_ONCE]
        means[rows] = _at(signal, starts[rows], finer * interval).mean(axis=1)
    return np.asarray(means)


def _at(signal: Callable[[Array], Array], starts: Array, within: Array) -> Array:
    """Return `signal` at the times `within` (m,) after each of `starts` (n,), shape (n, m)."""
    times = starts[:, np.newaxis] + within
    return np.asarray(signal(times.ravel())).reshape(times.shape)
