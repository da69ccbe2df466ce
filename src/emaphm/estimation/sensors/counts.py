"""Channels that show a slow quantity in the steps of a converter.

Where a count lasts several rows, what rounding leaves is no noise: it is the same in all of these rows, and
follows from the quantity. Least squares take it for an effect of whatever looks like it, a sensor's scale for
one. A model's signal is therefore rounded as the recorded one was before the two are compared.
"""

import numpy as np

from emaphm.arrays import Array
from emaphm.recording.sensor_checks.resolution import runs_of_equal, step_of_counts

ON_GRID = 0.05
"""Distance from a whole count, in counts, below which a value is on it: files round."""

LEAST_ROWS = 2.0
"""Rows that a count lasts at least, on average, for rounding not to pass for white noise."""

MOST_RETURNS = 0.2
"""Share of counts of one row that lead back to where they came from: where noise is as large as a third of a
count there are more, and rounding is dithered (Widrow and Kollár 2008)."""

ROUNDING = 12**0.5
"""Count over the rms of what rounding to it leaves open."""


def visible_count(values: Array) -> float:
    """Return the count that a channel (n,) shows its quantity in, in its unit.

    0 where rows are on no grid, change with almost every row, or are dithered by noise.
    """
    first, lengths = runs_of_equal(values)
    if values.size < LEAST_ROWS * lengths.size or lengths.size < 2:
        return 0.0
    span, step = float(np.ptp(values)), step_of_counts(values)
    if step == 0:  # values differ by rounding alone
        return 0.0
    count = span / round(span / step)
    levels = (values[first] - values[0]) / count
    passed = float(np.abs(np.diff(levels)).sum())
    if np.max(np.abs(levels - np.round(levels))) > ON_GRID or values.size < LEAST_ROWS * passed:
        return 0.0
    returns = (lengths[1:-1] == 1) & (np.round(levels[2:] - levels[:-2]) == 0)
    return count if np.count_nonzero(returns) <= MOST_RETURNS * passed else 0.0


def in_counts(signals: Array, values: Array, count: float) -> Array:
    """Return `signals` (…, n) rounded to the grid of the recorded `values` (n,), whose step is `count`."""
    return np.asarray(values[0] + count * np.round((signals - values[0]) / count))


def scores_of_counts(jacobian: Array, values: Array) -> Array:
    """Return the covariance (d, d) of a `jacobian` (d, n) times what counts leave open, in squared counts.

    `values` (n,) are the recorded ones. A count that the signal passes has its rows' errors on both sides,
    which are taken as independent; of one that it turns or stands on, all rows share one error.
    """
    first, lengths = runs_of_equal(values)
    sums = np.add.reduceat(jacobian, first, axis=1)
    steps = np.sign(np.diff(values[first]))
    passes = np.zeros(first.size, bool)
    passes[1:-1] = steps[1:] == steps[:-1]
    passed = jacobian[:, np.repeat(passes, lengths)]
    open_sums = sums[:, ~passes]
    return np.asarray(passed @ passed.T + open_sums @ open_sums.T) / ROUNDING**2
