"""Interpolation between rows: of instants and means, of continuous and switching channels."""

import numpy as np

from emaphm.actuator.channels import Sampling
from emaphm.arrays import Array

HELD = ("enabled",)
"""Switching channels: they are held, since there is no state between their values."""

FULL_TURN = 2 * np.pi * 1.01
"""Largest range of an angle from a sensor that restarts with every turn [rad]."""


def continuous(angle: Array) -> Array:
    """Return an angle (n,) [rad], unwrapped if its sensor restarts with every turn."""
    known = np.isfinite(angle)
    if not np.any(known) or np.ptp(angle[known]) > FULL_TURN:
        return angle
    unwrapped = angle.copy()
    unwrapped[known] = np.unwrap(angle[known])
    return unwrapped


def curve(times: Array, values: Array, at: Array) -> Array:
    """Return the values at the times `at` (m,) of Akima's curve through `values` (n,) at `times` (n,)."""
    # Imported here: the import takes longer than reading a recording, and few recordings need it.
    from scipy.interpolate import Akima1DInterpolator

    return np.asarray(Akima1DInterpolator(times - times[0], values)(at - times[0]), float)


def edges_of(times: Array) -> Array:
    """Return the limits (n + 1,) of the intervals over which rows at `times` (n,) are means.

    The interval of the last row is unknown: the mean of the other intervals is used.
    """
    return np.append(times, times[-1] + np.diff(times).mean())


def last_state(times: Array, values: Array, at: Array) -> Array:
    """Return a state at other times; each row holds until the next row, as for a state logged on change.

    Parameters
    ----------
    times
        Times of the rows, shape (n,) [s], increasing.
    values
        States, shape (n,).
    at
        Times at which the state is evaluated, shape (m,) [s], increasing.

    Returns
    -------
    Shape (m,), NaN before the first of `times`.
    """
    # Times of loggers are decimal fractions: rounding must not lose a row.
    slack = 1e-6 * float(np.ptp(at)) / at.size
    rows = np.searchsorted(times, at + slack, side="right") - 1
    return np.where(rows >= 0, values[np.maximum(rows, 0)], np.nan)


def moved(times: Array, values: Array, at: Array, sampling: Sampling) -> Array:
    """Return a channel interpolated at other times.

    Instants are interpolated by Akima's curve, means by Akima's curve of their integral, as in
    `emaphm.recording.resampling.on_uniform_grid`.

    Parameters
    ----------
    times
        Times of the rows, shape (n,) [s], increasing.
    values
        Values of the channel, shape (n,), finite.
    at
        Times at which the channel is evaluated, shape (m,) [s], increasing.
    sampling
        Meaning of a row: "mean" or "instant".

    Returns
    -------
    Shape (m,), NaN at times that the channel does not cover.
    """
    from_edges, to_edges = (edges_of(times), edges_of(at)) if sampling == "mean" else (times, at)
    # Times of loggers are decimal fractions: rounding must not lose a row at either end.
    slack = 1e-6 * float(np.diff(times).mean())
    first, last = from_edges[0] - slack, from_edges[-1] + slack
    inside = np.clip(to_edges, from_edges[0], from_edges[-1])
    if sampling == "instant":
        interpolated = curve(times, values, inside)
        return np.where((at >= first) & (at <= last), interpolated, np.nan)
    integral = np.append(0.0, np.cumsum(values * np.diff(from_edges)))
    interpolated = np.diff(curve(from_edges, integral, inside)) / np.diff(to_edges)
    return np.where((to_edges[:-1] >= first) & (to_edges[1:] <= last), interpolated, np.nan)
