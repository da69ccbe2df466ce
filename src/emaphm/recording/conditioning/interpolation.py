"""Values between rows: of instants and of means, of what moves and of what switches."""

import numpy as np

from emaphm.actuator.channels import Sampling
from emaphm.arrays import Array

HELD = ("enabled",)
"""Channels that switch: nothing lies between their values."""

FULL_TURN = 2 * np.pi * 1.01
"""Range up to which an angle may be that of a sensor which starts anew with every turn [rad]."""


def continuous(angle: Array) -> Array:
    """Return an angle (n,) without the jumps of a sensor that starts anew with every turn."""
    known = np.isfinite(angle)
    if not np.any(known) or np.ptp(angle[known]) > FULL_TURN:
        return angle
    unwrapped = angle.copy()
    unwrapped[known] = np.unwrap(angle[known])
    return unwrapped


def curve(times: Array, values: Array, at: Array) -> Array:
    """Return the values at `at` (m,) of Akima's curve through `values` (n,) at `times` (n,)."""
    # Its import takes longer than a recording; few recordings need it.
    from scipy.interpolate import Akima1DInterpolator

    return np.asarray(Akima1DInterpolator(times - times[0], values)(at - times[0]), float)


def edges_of(times: Array) -> Array:
    """Return the limits (n + 1,) of the intervals that rows at `times` (n,) are means over.

    The last one's interval is not known: the mean of the others stands for it.
    """
    return np.append(times, times[-1] + np.diff(times).mean())


def last_state(times: Array, values: Array, at: Array) -> Array:
    """Return a state that was written when it changed at other times: it holds until the next row.

    Parameters
    ----------
    times
        When it was written, shape (n,) [s], increasing.
    values
        What it became, shape (n,).
    at
        When it is asked for, shape (m,) [s], increasing.

    Returns
    -------
    Shape (m,), NaN before the first of `times`.
    """
    # Times of loggers are decimal fractions: rounding must not cost a row.
    slack = 1e-6 * float(np.ptp(at)) / at.size
    rows = np.searchsorted(times, at + slack, side="right") - 1
    return np.where(rows >= 0, values[np.maximum(rows, 0)], np.nan)


def moved(times: Array, values: Array, at: Array, sampling: Sampling) -> Array:
    """Return a channel at other times.

    Instants are joined by Akima's curve; means by that of their integral, as in
    `emaphm.recording.resampling.on_uniform_grid`.

    Parameters
    ----------
    times
        When it was recorded, shape (n,) [s], increasing.
    values
        What was, shape (n,), finite.
    at
        When it is asked for, shape (m,) [s], increasing.
    sampling
        What a row is.

    Returns
    -------
    Shape (m,), NaN at times that the channel does not cover.
    """
    from_edges, to_edges = (edges_of(times), edges_of(at)) if sampling == "mean" else (times, at)
    # Times of loggers are decimal fractions: rounding must not cost a row at either end.
    slack = 1e-6 * float(np.diff(times).mean())
    first, last = from_edges[0] - slack, from_edges[-1] + slack
    inside = np.clip(to_edges, from_edges[0], from_edges[-1])
    if sampling == "instant":
        found = curve(times, values, inside)
        return np.where((at >= first) & (at <= last), found, np.nan)
    integral = np.append(0.0, np.cumsum(values * np.diff(from_edges)))
    found = np.diff(curve(from_edges, integral, inside)) / np.diff(to_edges)
    return np.where((to_edges[:-1] >= first) & (to_edges[1:] <= last), found, np.nan)
