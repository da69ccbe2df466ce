"""Reconstruction of the continuous signal from its recorded rows."""

from collections.abc import Callable
from functools import partial

import numpy as np

from emaphm.arrays import Array
from emaphm.recording.akima import AkimaCurve
from emaphm.recording.band_limited import (
    DEGREE,
    is_band_limited,
    is_well_sampled,
    spline_of_means,
    spline_through,
)
from emaphm.recording.jumps import ROUNDING, Curve, Jumps, with_jumps
from emaphm.recording.recording import Recording

FEWEST = 3
"""Least number of rows for a curve; fewer rows between two jumps are replaced by their mean."""

LOWER_DEGREE = 3
"""Degree of the alternative spline: the difference of the two splines exceeds the error of the better one."""

DENSE_S = 2e-3
"""Interval between rows [s] up to which the time of a jump within it has no noticeable effect."""


def reconstructed(recording: Recording, name: str) -> Callable[[Array], Array]:
    """Return the recorded channel `name` as a function of the time since the first row [s].

    The function maps times (n,) to values in the channel's unit, (n,). It is a smooth curve through the rows
    (Akima 1970) before and after each jump (`emaphm.recording.jumps`). If rows are means over an interval h,
    the curve passes through the interval midpoints, corrected by h²/24 of the second derivative, by which the
    mean differs from the value at the midpoint. Straight lines between rows would cut the corners: their
    error is 0.1 % for a 15 Hz command at 1 kHz. A smooth signal with few rows per cycle is interpolated by a
    spline, whose error for a 15 Hz command at 100 Hz is 0.01 % instead of the 1 % of Akima's curve.
    """
    interval, values = recording.interval_s, recording[name]
    if _is_smooth_without_jump(recording, name):
        return _spline(recording, name, DEGREE)
    means = recording.sampling == "mean"
    curve = with_jumps(values, interval, partial(_through, interval=interval, means=means), means=means)
    return _within(recording, curve)


def _through(rows: Array, start: float, interval: float, means: bool) -> Curve:
    """Return the smooth curve through `rows` (n,), the first of which is at the time `start` [s]."""
    if rows.size < FEWEST:
        return lambda times: np.full(times.size, float(np.mean(rows)))
    if not means:
        return AkimaCurve.through(rows, start, interval)
    bent = np.pad(np.diff(rows, 2), 1, mode="edge")
    return AkimaCurve.through(rows - bent / 24, start + interval / 2, interval)


def _within(recording: Recording, curve: Curve) -> Curve:
    """Return `curve` with its end values held beyond the recording."""
    rows = recording.samples if recording.sampling == "mean" else recording.samples - 1
    return lambda times: curve(np.clip(times, 0.0, rows * recording.interval_s))


def other_curve(recording: Recording, name: str) -> Callable[[Array], Array] | None:
    """Return an alternative to the curve of `reconstructed` through the same rows, None for dense rows.

    It maps times since the first row [s], (n,), to values of the channel `name` in its unit, (n,). The
    difference of the two curves indicates the reconstruction error.

    For a smooth signal with few rows per cycle, the alternative is a spline of lower degree, whose error is
    larger. For slow rows of any other signal, it is a curve without jumps if jumps were detected, else a
    zero-order hold: a jump may lie anywhere between two rows.
    """
    if _is_smooth_without_jump(recording, name):
        return _spline(recording, name, LOWER_DEGREE)
    if recording.interval_s <= DENSE_S or is_well_sampled(recording[name]):
        return None
    means = recording.sampling == "mean"
    if Jumps.of(recording[name], means=means).before.size == 0:
        return held(recording, name)
    return _within(recording, _through(recording[name], 0.0, recording.interval_s, means))


def _is_smooth_without_jump(recording: Recording, name: str) -> bool:
    """Return whether a channel is a smooth signal with few rows per cycle, without a jump at its ends.

    A jump at the first or last row has so few differences that the signal may still seem smooth.
    """
    values = recording[name]
    if not is_band_limited(values):
        return False
    jumps = Jumps.of(values, means=recording.sampling == "mean")
    return not (np.any(jumps.before == 0) or np.any(jumps.after == values.size - 1))


def _spline(recording: Recording, name: str, degree: int) -> Callable[[Array], Array]:
    interval, values = recording.interval_s, recording[name]
    means = recording.sampling == "mean"
    return _within(recording, (spline_of_means if means else spline_through)(values, interval, degree))


def held(recording: Recording, name: str) -> Callable[[Array], Array]:
    """Return a zero-order hold of a recorded switch, as a function of the time since the first row [s], (n,).

    Row n holds over [n h, (n + 1) h), with h the interval; the first and the last row also hold beyond the
    recording. There is no state between on and off: a curve through the rows would be half on for an
    interval. Values are those of the channel `name` in its unit, (n,).
    """
    interval, values = recording.interval_s, recording[name]

    def value(times: Array) -> Array:
        # The times of model steps are multiples of a fraction of the interval: rounding must not lose a row.
        row = np.floor(times / interval + ROUNDING).astype(np.intp)
        return np.asarray(values[np.clip(row, 0, values.size - 1)])

    return value
