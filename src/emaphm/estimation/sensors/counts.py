"""Rounding errors of channels that stay on one count of a converter for several rows.

Such an error is not noise: it is the same in all of these rows, and least squares attribute it to a parameter
with a similar effect, for example the scale of a sensor. If counts are visible throughout a channel, the
model's signal is rounded like the recorded one before they are compared. At the rests of a channel whose
motion passes several counts a row, the error is part of the covariance only.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.recording.sensor_checks.resolution import runs_of_equal, step_of_counts

Rows: TypeAlias = NDArray[np.intp]
"""Indices or numbers of rows, (groups,)."""

ON_GRID = 0.05
"""Largest distance of a value from a whole count [counts], because files round values."""

LEAST_ROWS = 2.0
"""Least mean number of rows per count for which the rounding error does not act as white noise."""

MOST_RETURNS = 0.2
"""Largest share of counts of one row that return to the count before. There are more if the noise exceeds a
third of a count: it then dithers the rounding, whose error is white (Widrow and Kollár 2008)."""

LEAST_REST = 20
"""Least number of rows of a rest: the shared error of fewer rows hardly exceeds their white noise."""

ROUNDING = 12**0.5
"""Count relative to the rms of its rounding error."""


def visible_count(values: Array) -> float:
    """Return the visible count of a channel (n,), in its unit.

    It is 0 if the values are on no grid, change in almost every row, or are dithered by noise.
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


@dataclass(frozen=True, eq=False)
class SharedErrors:
    """Rounding errors that successive rows of a channel share.

    A group of rows begins at `first`, has `lengths` rows and an error whose rms is `errors`, in the unit of
    the channel; (groups,) each. Errors of different groups are independent.
    """

    first: Rows
    lengths: Rows
    errors: Array

    def scores(self, jacobian: Array) -> Array:
        """Return the covariance (d, d) of a `jacobian` (d, n) times the errors of the rows."""
        ends = np.stack([self.first, self.first + self.lengths], axis=1).reshape(-1)
        padded = np.pad(jacobian, ((0, 0), (0, 1)))
        sums = np.add.reduceat(padded, ends, axis=1)[:, ::2] * self.errors
        return np.asarray(sums @ sums.T)


def shared_errors(values: Array, count: float) -> SharedErrors | None:
    """Return the rounding errors that rows of a channel (n,) share, or None.

    `count` is that of `visible_count`.
    """
    groups = errors_of_counts(values, count) if count > 0 else errors_of_rests(values)
    return groups if groups.first.size else None


def errors_of_counts(values: Array, count: float) -> SharedErrors:
    """Return the rounding errors of a channel (n,) with a visible `count`.

    The errors of the rows of a count that the signal passes through have both signs and are taken as
    independent. The rows of a count at which the signal turns or rests share one error.
    """
    first, lengths = runs_of_equal(values)
    steps = np.sign(np.diff(values[first]))
    passes = np.zeros(first.size, bool)
    passes[1:-1] = steps[1:] == steps[:-1]
    alone = np.repeat(passes, lengths)
    begins = np.union1d(np.flatnonzero(alone), first[~passes])
    sizes = np.diff(np.concatenate([begins, [values.size]]))
    return SharedErrors(begins, sizes, np.full(begins.size, count / ROUNDING))


def errors_of_rests(values: Array) -> SharedErrors:
    """Return the rounding errors at the rests of a channel (n,) whose counts are not visible in motion.

    At a rest of `LEAST_REST` rows and more, the channel stays at one count, or noise lets it alternate
    between two. At one count, the error is that of rounding, q/√12. With a share p of the rows at the upper
    one of two counts, the mean deviates by up to q |p - 1/2|: by that much for a small noise, by less for a
    larger noise, which such a rest does not determine. Noise of more than half a count reaches a third count.
    """
    first, lengths = _rests(values)
    if not first.size:
        return SharedErrors(first, lengths, np.zeros(0))
    rests = [values[start : start + length] for start, length in zip(first, lengths, strict=True)]
    step = step_of_counts(values)
    errors = np.array([_error_of_rest(rest, step) for rest in rests])
    is_rounding = np.array([float(np.ptp(rest)) < 1.5 * step for rest in rests], bool)
    return SharedErrors(first[is_rounding], lengths[is_rounding], errors[is_rounding])


def _error_of_rest(rest: Array, step: float) -> float:
    """Return the rms of the error that the rows of a rest share, see `errors_of_rests`."""
    upper = float(np.mean(rest > rest.min()))
    return step * abs(upper - 0.5) if upper > 0 else step / ROUNDING


def _rests(values: Array) -> tuple[Rows, Rows]:
    """Return first rows and lengths of stretches at one value, or alternating between two adjacent ones."""
    first, _ = runs_of_equal(values)
    alternating = np.concatenate([[False], values[first][2:] == values[first][:-2], [False]])
    changes = np.flatnonzero(np.diff(alternating))
    begins = np.ones(first.size, bool)
    for start, end in zip(changes[::2], changes[1::2], strict=True):
        begins[start + 1 : end + 2] = False
    first = first[begins]
    lengths = np.diff(np.concatenate([first, [values.size]]))
    long = lengths >= LEAST_REST
    return first[long], lengths[long]
