"""Detection of jumps of a recorded signal, and curves through its rows that keep the jumps.

A smooth curve through the rows would replace a jump by a ramp that lasts one interval. A drive that saturates
responds to the first part of the ramp as to the whole jump, half an interval early.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array

Curve = Callable[[Array], Array]

ROUNDING = 1e-9
"""Largest rounding error of a time, as a share of the interval."""


@dataclass(frozen=True)
class JumpSettings:
    """Thresholds from which a change counts as a jump.

    A jump is at least `apart` times the sum of the changes before and after it, and `usual` times the median
    change of the signal. The changes of a smooth signal are similar to their neighbours, and those of white
    noise are at most 6 times their median in a million rows.
    """

    apart: float = 10.0
    usual: float = 10.0


JUMPS = JumpSettings()


@dataclass(frozen=True, eq=False)
class Jumps:
    """Indices of the last row `before` each jump and of the first row `after` it, (n,) each.

    If rows are means, the row between these two contains the jump and may average both sides.
    """

    before: NDArray[np.intp]
    after: NDArray[np.intp]

    @classmethod
    def of(cls, values: Array, *, means: bool) -> "Jumps":
        """Return the jumps of `values` (samples,), which are `means` over their intervals, else instants."""
        rows = 2 if means else 1
        none = np.zeros(0, np.intp)
        if values.size < rows + 2:
            return cls(none, none)
        steps = np.abs(np.diff(values))
        changes = np.abs(values[rows:] - values[:-rows])
        around = np.zeros_like(changes)
        around[1:] += steps[: around.size - 1]
        around[:-1] += steps[rows:]
        excess = changes - np.maximum(JUMPS.apart * around, JUMPS.usual * np.median(steps))
        large = excess > 0
        # If rows are means, a jump may appear in two changes: the change with the larger excess is used.
        large[1:] &= excess[1:] > excess[:-1]
        large[:-1] &= excess[:-1] >= excess[1:]
        before = np.flatnonzero(large)
        return cls(before, before + rows)

    def changes_between(self, values: Array) -> Array:
        """Return the changes from row to row of `values` (samples,), 0 at the jumps, (samples - 1,)."""
        changes = np.diff(values)
        for before, after in zip(self.before, self.after, strict=True):
            changes[before:after] = 0.0
        return changes


def with_jumps(
    values: Array, interval: float, curve_of: Callable[[Array, float], Curve], *, means: bool
) -> Curve:
    """Return the signal through the rows `values` (samples,) as a function of time [s], jumps included.

    Parameters
    ----------
    values
        Rows of the signal, (samples,), the first at time 0.
    interval
        Time between rows [s].
    curve_of
        Function of rows without a jump, (n,), and of the time of the first row [s]; it returns the curve
        through them, which extrapolates beyond them.
    means
        Whether rows are means over the interval that they begin. The time of a jump is then chosen such that
        the mean over its row equals the row's value; for instants, it is the first row after the jump.
    """
    jumps = Jumps.of(values, means=means)
    firsts = np.concatenate([[0], jumps.after]).astype(np.intp)
    lasts = np.concatenate([jumps.before, [values.size - 1]]).astype(np.intp)
    curves = [
        curve_of(values[first : last + 1], first * interval)
        for first, last in zip(firsts, lasts, strict=True)
    ]
    if len(curves) == 1:
        return curves[0]
    times = np.asarray(firsts[1:] * interval, float)
    if means:
        middle = times - interval / 2
        left, right = (
            np.array([float(curve(middle[i : i + 1])[0]) for i, curve in enumerate(side)])
            for side in (curves[:-1], curves[1:])
        )
        # If both curves agree in the row, the jump has no identifiable time: the begin of the row is used.
        missing, step = right - values[firsts[1:] - 1], right - left
        share = np.clip(np.divide(missing, step, out=np.zeros_like(step), where=step != 0), 0.0, 1.0)
        times = times - (1 - share) * interval
    return _joined(curves, times - ROUNDING * interval)


def _joined(curves: list[Curve], begins: Array) -> Curve:
    """Return the curve that equals each of `curves` (n) until the next begins, at `begins` (n - 1,) [s]."""

    def value(times: Array) -> Array:
        order = np.argsort(times, kind="stable")
        ascending = times[order]
        ends = [0, *np.searchsorted(ascending, begins), times.size]
        values = np.empty(times.size)
        for curve, first, last in zip(curves, ends[:-1], ends[1:], strict=True):
            if last > first:
                values[order[first:last]] = curve(ascending[first:last])
        return values

    return value
