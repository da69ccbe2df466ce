"""Jumps of a recorded signal: where it changes at once, between two rows or within one.

A curve through the rows would make a ramp of a jump, an interval long. A drive that saturates answers to the
ramp's first part as to the whole jump, half an interval early.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array

Curve = Callable[[Array], Array]

ROUNDING = 1e-9
"""Share of an interval by which a time may be early through rounding."""


@dataclass(frozen=True)
class JumpSettings:
    """From when on a change is a jump.

    It is `apart` times as large as the changes before and after it together, and `usual` times as large as
    the median change of the signal: a smooth signal's changes are like their neighbours', and those of white
    noise are up to 6 times their median in a million rows.
    """

    apart: float = 10.0
    usual: float = 10.0


JUMPS = JumpSettings()


@dataclass(frozen=True, eq=False)
class Jumps:
    """The last row `before` each jump and the first row `after` it, (n,) each.

    Where rows are means, one row lies between them that may hold a part of either side.
    """

    before: NDArray[np.intp]
    after: NDArray[np.intp]

    @classmethod
    def of(cls, values: Array, *, means: bool) -> "Jumps":
        """Return the jumps of rows (samples,), which are `means` over their intervals or instants."""
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
        # Where rows are means, one jump may show in two changes: the one that stands out more is taken.
        large[1:] &= excess[1:] > excess[:-1]
        large[:-1] &= excess[:-1] >= excess[1:]
        before = np.flatnonzero(large)
        return cls(before, before + rows)


def with_jumps(
    values: Array, interval: float, curve_of: Callable[[Array, float], Curve], *, means: bool
) -> Curve:
    """Return a signal behind its rows (samples,) as a function of time [s], its jumps as such.

    Parameters
    ----------
    interval
        Between rows [s], the first at 0.
    curve_of
        Returns the curve through rows without a jump, (n,), the first of which is at a time [s]; it goes on
        beyond them.
    means
        Whether rows are means over the interval that they begin. A jump is then where it makes the row that
        it lies in what it is; of instants, it is at the first row after it.
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
            np.array([float(curve(middle[i : i + 1])[0]) for i, curve in enumerate(some)])
            for some in (curves[:-1], curves[1:])
        )
        # Where both curves agree in the row, no time of a jump is likelier than its begin.
        missing, step = right - values[firsts[1:] - 1], right - left
        share = np.clip(np.divide(missing, step, out=np.zeros_like(step), where=step != 0), 0.0, 1.0)
        times = times - (1 - share) * interval
    return _joined(curves, times - ROUNDING * interval)


def _joined(curves: list[Curve], begins: Array) -> Curve:
    """Return the curve that follows each of `curves` until the next one begins, `begins` (n - 1,) [s]."""

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
