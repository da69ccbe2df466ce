"""What a sensor outside of the control loop makes of a sampled signal: lag, delay, errors, rounding.

All act on rows that are h apart. Lag and delay are linear and invariant in time, and so is the mean over a
sample interval: they commute. The mean of a lagged signal is the lagged mean, so that the same functions
serve for instants and for interval means. Between rows the signal is the cubic polynomial through the two
rows to either side (Lagrange); before the first row it rests at that row's value.
"""

import numpy as np
from numpy.typing import ArrayLike

from emaphm.actuator.sensors import IDEAL, Sensor
from emaphm.arrays import Array
from emaphm.errors import MethodError

LAGRANGE = (
    np.array(
        [
            [0.0, -2.0, 3.0, -1.0],
            [6.0, -3.0, -6.0, 3.0],
            [0.0, 6.0, 3.0, -3.0],
            [0.0, -1.0, 0.0, 1.0],
        ]
    )
    / 6
)
"""Lagrange's polynomials for nodes at s = -1, 0, 1, 2 (rows): coefficients of 1, s, s², s³ (columns)."""

NEGLIGIBLE = 1e-18
"""Share of a past value below which a lag has forgotten it: less than rounding."""


def sensed(signal: Array, sensor: Sensor, interval: float, noise: Array | float = 0.0) -> Array:
    """Return what a described sensor makes of a signal, but for rounding.

        y = (1 + s) x_{lag, delay} + o + n;   |y| where only the magnitude is recorded

    Parameters
    ----------
    signal : x, rows of instants or of interval means, shape (…, n)
    sensor : lag and delay [s], s relative, o in the unit of x
    interval : h, between rows [s]
    noise : n, of each row, in the unit of x

    Returns
    -------
    y, in the unit of x, shape (…, n); x itself where the sensor is ideal.

    Raises
    ------
    MethodError
        The delay is as long as the signal.
    """
    if sensor == IDEAL:
        return signal
    if sensor.delay >= signal.shape[-1] * interval:
        raise MethodError(
            f"a sensor with a delay of {sensor.delay:g} s shows nothing of a recording of "
            f"{signal.shape[-1] * interval:g} s; correct it under [sensors] in the actuator's TOML"
        )
    late = delayed(lagged(signal, interval, sensor.lag), interval, sensor.delay)
    shown = with_static_errors(late, sensor.scale, sensor.offset) + noise
    return np.asarray(np.abs(shown) if sensor.unsigned else shown)


def lagged(signal: Array, interval: float, lag: ArrayLike) -> Array:
    """Return a signal behind a first-order lag, T dy/dt = x - y, exactly for cubic x between the rows.

        y_n = e^{-h/T} y_{n-1} + ∫₀¹ (h/T) e^{-(1-s) h/T} x(t_{n-1} + s h) ds,   y_0 = x_0

    Parameters
    ----------
    signal : x, rows of instants or of interval means, shape (…, n)
    interval : h, between rows [s]
    lag : T ≥ 0, a number or one of each signal, shape (…,) [s]

    Returns
    -------
    y, in the unit of x, shape (…, n).

    Notes
    -----
    For a sine of angular frequency ω the error is 3/128 (ω h)⁴ of it at most. The signal is taken as at rest
    before its first row: a recording that starts on the move is off for some T.
    """
    tau = np.asarray(lag, float)[..., np.newaxis] / interval
    if not np.any(tau > 0):
        return signal
    # Shorter ones have no effect within rounding.
    tau = np.maximum(tau, 1e-9)
    decay = np.exp(-1 / tau)
    weights = _moments(tau[..., 0], decay[..., 0]) @ LAGRANGE.T
    padded = _padded(signal, 2)
    rows = signal.shape[-1]
    result = sum(weights[..., k, np.newaxis] * padded[..., k : k + rows] for k in range(4))
    assert isinstance(result, np.ndarray)  # noqa: S101 - a sum of arrays
    result[..., 0] = signal[..., 0]
    # Σ_k decay^k u_{n-k} by doubling: each pass adds to the sum over 2^i rows that of the 2^i rows before.
    reach = 1
    while reach < rows and np.any(decay**reach > NEGLIGIBLE):
        result[..., reach:] += decay**reach * result[..., :-reach]
        reach *= 2
    return np.asarray(result)


def delayed(signal: Array, interval: float, delay: ArrayLike) -> Array:
    """Return a signal behind a pure delay, y(t) = x(t - d).

    Parameters
    ----------
    signal : x, rows of instants or of interval means, shape (…, n)
    interval : h, between rows [s]
    delay : d ≥ 0, a number or one of each signal, shape (…,) [s]

    Returns
    -------
    y, in the unit of x, shape (…, n): exact for cubic x, and for whole multiples of h.
    """
    shift = np.asarray(delay, float)[..., np.newaxis] / interval
    if not np.any(shift > 0):
        return signal
    rows = signal.shape[-1]
    whole = np.floor(shift)
    weights = _powers(1 - (shift - whole))[..., 0, :] @ LAGRANGE.T
    first = np.arange(rows) - whole.astype(np.intp)
    padded = _padded(signal, 2)
    result = np.zeros(np.broadcast_shapes(signal.shape, (*shift.shape[:-1], rows)))
    for k in range(4):
        column = np.broadcast_to(np.clip(first + k, 0, rows + 2), result.shape)
        taken = np.take_along_axis(np.broadcast_to(padded, (*result.shape[:-1], rows + 3)), column, axis=-1)
        result += weights[..., k, np.newaxis] * taken
    return result


def with_static_errors(signal: Array, scale: float, offset: float) -> Array:
    """Return what a sensor with errors of scale and zero shows: y = (1 + s) x + o.

    Parameters
    ----------
    signal : x
    scale : s > -1, relative error of the scale [-]
    offset : o, what is shown at 0, in the unit of x
    """
    return (1 + scale) * signal + offset


def without_static_errors(shown: Array, scale: float, offset: float) -> Array:
    """Return the x that `with_static_errors` makes `shown` of: x = (y - o) / (1 + s)."""
    return (shown - offset) / (1 + scale)


def rounded(signal: Array, resolution: float) -> Array:
    """Return a signal in whole counts of `resolution`, rounded to the nearest; unchanged where that is 0."""
    return np.round(signal / resolution) * resolution if resolution else signal


def _padded(signal: Array, before: int) -> Array:
    """Return `signal` (…, n) with its first value `before` times before it and a parabola's next after."""
    held = np.repeat(signal[..., :1], before, axis=-1)
    after = 3 * (signal[..., -1:] - signal[..., -2:-1]) + signal[..., -3:-2]
    return np.concatenate([held, signal, after], axis=-1)


def _powers(s: Array) -> Array:
    """Return 1, s, s², s³ along a new last axis."""
    return np.asarray(s[..., np.newaxis] ** np.arange(4))


def _moments(tau: Array, decay: Array) -> Array:
    """Return ∫₀¹ (1/τ) e^{-(1-s)/τ} s^k ds for k = 0 … 3 along a new last axis; `decay` is e^{-1/τ}.

    By parts, M_k = 1 - k τ M_{k-1}; for τ > 1 that cancels, and Gauss's rule is exact to rounding.
    """
    nodes, weights = np.polynomial.legendre.leggauss(10)
    s = (1 + nodes) / 2
    kernel = np.exp(-(1 - s) / np.maximum(tau, 1.0)[..., np.newaxis]) / np.maximum(tau, 1.0)[..., np.newaxis]
    by_rule = (kernel * weights / 2) @ _powers(s)
    by_parts = [1 - decay]
    for k in range(1, 4):
        by_parts.append(1 - k * tau * by_parts[-1])
    return np.where((tau > 1.0)[..., np.newaxis], by_rule, np.stack(by_parts, axis=-1))
