"""Channels that show a slow quantity in the steps of a converter.

Where a count lasts several rows, what rounding leaves is no noise: it is the same in all of these rows, and
follows from the quantity. Least squares take it for an effect of whatever looks like it, a sensor's scale for
one. A model's signal is therefore rounded as the recorded one was before the two are compared.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array, Flags
from emaphm.recording.sensor_checks.resolution import runs_of_equal, step_of_counts

Rows: TypeAlias = NDArray[np.intp]
"""Indices or numbers of rows, (runs,)."""

ON_GRID = 0.05
"""Distance from a whole count, in counts, below which a value is on it: files round."""

LEAST_ROWS = 2.0
"""Rows that share a count, averaged over the rows, from which on rounding does not act as white noise."""

MOST_REVERSALS = 0.3
"""Reversals between neighbouring counts, per row, from which on rounding is dithered.

A constant signal with white noise σ changes between counts of width q 2σ / (√π q) times per row, averaged
over its position within a count (σ < q/3): 0.14 for σ = q/8, 0.3 for σ = 0.27 q, where noise dithers most of
the error (Widrow and Kollár 2008).
"""

LEAST_ALTERNATIONS = 4
"""Successive runs that alternate between two counts, from which on they are one rest near an edge."""

ROUNDING = 12**0.5
"""Count over the rms of the rounding error."""


def visible_count(values: Array) -> float:
    """Return the count whose rounding error successive rows of a channel (n,) share, in the channel's unit.

    0 where the rows are on no grid, change with almost every row, or are dithered by noise. A position that
    passes several counts a row in motion shares its rounding error over a rest.
    """
    first, lengths = runs_of_equal(values)
    if lengths.size < 2:
        return 0.0
    span, step = float(np.ptp(values)), step_of_counts(values)
    if step == 0:  # values differ by rounding alone
        return 0.0
    count = span / round(span / step)
    levels = (values - values[0]) / count
    if np.max(np.abs(levels - np.round(levels))) > ON_GRID or _is_dithered(levels, first, lengths):
        return 0.0
    first, lengths = shared_counts(values)
    slow = _between_neighbours(levels, first, lengths)
    sharing = float(np.sum(lengths[slow] ** 2) + np.sum(lengths[~slow])) / values.size
    return count if sharing >= LEAST_ROWS else 0.0


def shared_counts(values: Array) -> tuple[Rows, Rows]:
    """Return the first rows and the lengths of the runs in which rows (n,) share a rounding error.

    These are runs of equal values; where noise lets a rest alternate between two counts, all of the rest.
    """
    first, _ = runs_of_equal(values)
    alternating = np.concatenate([[False], values[first][2:] == values[first][:-2], [False]])
    changes = np.flatnonzero(np.diff(alternating))
    begins = np.ones(first.size, bool)
    for start, end in zip(changes[::2], changes[1::2], strict=True):
        if end + 2 - start >= LEAST_ALTERNATIONS:
            begins[start + 1 : end + 2] = False
    begun = first[begins]
    return begun, np.diff(np.concatenate([begun, [values.size]]))


def _is_dithered(levels: Array, first: Rows, lengths: Rows) -> bool:
    """Return whether slow rows reverse so often that their mean resolves fractions of a count."""
    steps = np.round(np.diff(levels[first]))
    reversals = np.count_nonzero((np.abs(steps[1:]) == 1) & (steps[1:] == -steps[:-1]))
    slow = _between_neighbours(levels, first, lengths)
    return bool(reversals >= max(1.0, MOST_REVERSALS * float(np.sum(lengths[slow]))))


def _between_neighbours(levels: Array, first: Rows, lengths: Rows) -> Flags:
    """Return of each run whether it is one count from the runs before and after it."""
    last = first + lengths - 1
    near = np.round(np.abs(levels[first[1:]] - levels[last[:-1]])) == 1
    return np.asarray(np.concatenate([[True], near]) & np.concatenate([near, [True]]))


def in_counts(signals: Array, values: Array, count: float) -> Array:
    """Return `signals` (…, n) rounded to the grid of the recorded `values` (n,), whose step is `count`."""
    return np.asarray(values[0] + count * np.round((signals - values[0]) / count))


def scores_of_counts(jacobian: Array, values: Array) -> Array:
    """Return the covariance (d, d) of a `jacobian` (d, n) times what counts leave open, in squared counts.

    `values` (n,) are the recorded ones. A count that the signal passes has its rows' errors on both sides,
    which are taken as independent; of one that it turns or stands on, all rows share one error.
    """
    first, lengths = shared_counts(values)
    sums = np.add.reduceat(jacobian, first, axis=1)
    steps = np.sign(values[first[1:]] - values[(first + lengths - 1)[:-1]])
    passes = np.zeros(first.size, bool)
    passes[1:-1] = steps[1:] == steps[:-1]
    passed = jacobian[:, np.repeat(passes, lengths)]
    open_sums = sums[:, ~passes]
    return np.asarray(passed @ passed.T + open_sums @ open_sums.T) / ROUNDING**2
