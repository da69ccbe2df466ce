"""The signal behind its recorded rows."""

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
"""Rows that a curve needs; fewer between two jumps stand still."""

LOWER_DEGREE = 3
"""Of the other spline: what the two differ is more than the error of the better one."""

DENSE_S = 2e-3
"""Rows no farther apart leave no time for a jump that matters [s]."""


def reconstructed(recording: Recording, name: str) -> Callable[[Array], Array]:
    """Return the recorded channel `name` as a function of the time since the first row [s].

    The function maps times (n,) to values in the channel's unit, (n,). It is a smooth curve through the rows
    (Akima 1970) up to a jump and from it on (`emaphm.recording.jumps`). Where rows are means, through the
    interval midpoints, by what a mean over an interval h falls short of a curve's midpoint there, h²/24 of
    its second derivative. A straight line between rows would cut the corners: of a 15 Hz command at 1 kHz it
    loses 0.1 %. Of few rows a cycle of a smooth signal, a spline loses less than Akima's curve: of a 15 Hz
    command at 100 Hz 0.01 % instead of 1 %.
    """
    interval, values = recording.interval_s, recording[name]
    if _is_smooth(recording, name):
        return _spline(recording, name, DEGREE)
    means = recording.sampling == "mean"
    curve = with_jumps(values, interval, partial(_through, interval=interval, means=means), means=means)
    return _within(recording, curve)


def _through(rows: Array, start: float, interval: float, means: bool) -> Curve:
    """Return the smooth curve through rows (n,) of which the first is at `start` [s]."""
    if rows.size < FEWEST:
        return lambda times: np.full(times.size, float(np.mean(rows)))
    if not means:
        return AkimaCurve.through(rows, start, interval)
    bent = np.pad(np.diff(rows, 2), 1, mode="edge")
    return AkimaCurve.through(rows - bent / 24, start + interval / 2, interval)


def _within(recording: Recording, curve: Curve) -> Curve:
    """Return a curve that holds its ends beyond the recording."""
    rows = recording.samples if recording.sampling == "mean" else recording.samples - 1
    return lambda times: curve(np.clip(times, 0.0, rows * recording.interval_s))


def other_curve(recording: Recording, name: str) -> Callable[[Array], Array] | None:
    """Return another curve that has the same rows as that of `reconstructed`, None where these are dense.

    It maps times since the first row [s], (n,), to values of the channel `name` in its unit, (n,).

    Of few rows a cycle of a smooth signal, a spline of lower degree, whose error is larger. Of slow rows of
    any other signal, one without jumps where there seem to be some; else what holds each value until the next
    row: a jump may lie anywhere between two rows.
    """
    if _is_smooth(recording, name):
        return _spline(recording, name, LOWER_DEGREE)
    if recording.interval_s <= DENSE_S or is_well_sampled(recording[name]):
        return None
    means = recording.sampling == "mean"
    if Jumps.of(recording[name], means=means).before.size == 0:
        return held(recording, name)
    return _within(recording, _through(recording[name], 0.0, recording.interval_s, means))


def _is_smooth(recording: Recording, name: str) -> bool:
    """Return whether the rows of a channel are few a cycle of a smooth signal, and not behind a jump.

    A jump in the first row or the last has so few differences that it may pass for a smooth signal.
    """
    values = recording[name]
    if not is_band_limited(values):
        return False
    jumps = Jumps.of(values, means=recording.sampling == "mean")
    return not (np.any(jumps.before == 0) or np.any(jumps.after == values.size - 1))


def _spline(recording: Recording, name: str, degree: int) -> Callable[[Array], Array]:
    interval, values = recording.interval_s, recording[name]
    mean = recording.sampling == "mean"
    return _within(recording, (spline_of_means if mean else spline_through)(values, interval, degree))


def held(recording: Recording, name: str) -> Callable[[Array], Array]:
    """Return a recorded switch as a function of the time since the first row [s], (n,): a zero-order hold.

    Row n holds over [n h, (n + 1) h), h the interval, the first and the last one beyond the recording too.
    Nothing lies between on and off: a curve through the rows would be half on for an interval. Values are
    those of the channel `name` in its unit, (n,).
    """
    interval, values = recording.interval_s, recording[name]

    def value(times: Array) -> Array:
        # Times of steps come as multiples of a fraction of the interval: rounding must not lose a row.
        row = np.floor(times / interval + ROUNDING).astype(np.intp)
        return np.asarray(values[np.clip(row, 0, values.size - 1)])

    return value
