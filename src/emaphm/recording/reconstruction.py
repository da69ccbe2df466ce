"""The signal behind its recorded rows."""

from collections.abc import Callable

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
from emaphm.recording.recording import Recording

LOWER_DEGREE = 3
"""Of the other spline: what the two differ is more than the error of the better one."""

DENSE_S = 2e-3
"""Rows no farther apart leave no time for a jump that matters [s]."""

ROUNDING = 1e-9
"""Share of an interval by which a time may be early through rounding."""


def reconstructed(recording: Recording, name: str) -> Callable[[Array], Array]:
    """Return a recorded channel as a function of the time since the first row [s].

    A smooth curve through the rows (Akima 1970), which does not overshoot next to a jump as splines do. Where
    rows are means, through the interval midpoints, by what a mean over an interval h falls short of a curve's
    midpoint there, h²/24 of its second derivative. A straight line between rows would cut the corners: of a
    15 Hz command at 1 kHz it loses 0.1 %. Of few rows a cycle of a smooth signal, a spline loses less than
    Akima's curve: of a 15 Hz command at 100 Hz 0.01 % instead of 1 %.
    """
    interval, values = recording.interval_s, recording[name]
    if is_band_limited(values):
        return _spline(recording, name, DEGREE)
    start, last = 0.0, (recording.samples - 1) * interval
    if recording.sampling == "mean":
        bent = np.pad(np.diff(values, 2), 1, mode="edge")
        start, values, last = interval / 2, values - bent / 24, last + interval
    curve = AkimaCurve.through(values, start, interval)
    return lambda times: curve(np.clip(times, 0.0, last))


def other_curve(recording: Recording, name: str) -> Callable[[Array], Array] | None:
    """Return another curve that has the same rows as `reconstructed`, None where the rows are dense.

    Of few rows a cycle of a smooth signal, a spline of lower degree, whose error is larger. Of slow rows of
    any other signal, what holds each value until the next row: a jump may lie anywhere between two rows.
    """
    if is_band_limited(recording[name]):
        return _spline(recording, name, LOWER_DEGREE)
    dense = recording.interval_s <= DENSE_S or is_well_sampled(recording[name])
    return None if dense else held(recording, name)


def _spline(recording: Recording, name: str, degree: int) -> Callable[[Array], Array]:
    interval, values = recording.interval_s, recording[name]
    mean = recording.sampling == "mean"
    spline = (spline_of_means if mean else spline_through)(values, interval, degree)
    end = (values.size if mean else values.size - 1) * interval
    return lambda times: spline(np.clip(times, 0.0, end))


def held(recording: Recording, name: str) -> Callable[[Array], Array]:
    """Return a recorded switch as a function of the time since the first row [s]: a zero-order hold.

    Row n holds over [n h, (n + 1) h), h the interval, the first and the last one beyond the recording too.
    Nothing lies between on and off: a curve through the rows would be half on for an interval.
    """
    interval, values = recording.interval_s, recording[name]

    def value(times: Array) -> Array:
        # Times of steps come as multiples of a fraction of the interval: rounding must not lose a row.
        row = np.floor(times / interval + ROUNDING).astype(np.intp)
        return np.asarray(values[np.clip(row, 0, values.size - 1)])

    return value
