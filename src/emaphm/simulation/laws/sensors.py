"""Sensors outside of the control loop: lag, delay, static errors and rounding of a sampled signal.

The functions act on rows at intervals h. Lag, delay and the mean over a sample interval are linear and
time-invariant, so they commute: the mean of a lagged signal is the lagged mean. The same functions therefore
serve for instants and for interval means. Between rows the signal is the cubic polynomial through the two
rows on each side (Lagrange); before the first row it is constant at the value of that row.
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
"""Weight of a past value in a lagged signal below which it is neglected: less than rounding."""


def sensed(signal: Array, sensor: Sensor, interval: float, noise: Array | float = 0.0) -> Array:
    """Return the output of a described sensor for a signal, without rounding.

        y = (1 + s) x_{lag, delay} + o + n;   |y| if the sensor records only the magnitude

    Parameters
    ----------
    signal : x, rows of instants or of interval means, shape (…, n)
    sensor : lag T and delay d [s], relative error of the scale s [-], offset o in the unit of x
    interval : h, between rows [s]
    noise : n, noise of each row, in the unit of x

    Returns
    -------
    y, in the unit of x, shape (…, n); x itself if the sensor is ideal.

    Raises
    ------
    MethodError
        The delay is as long as the signal.
    """
    if sensor == IDEAL:
        return signal
    if sensor.delay >= signal.shape[-1] * interval:
        raise MethodError(
            f"a sensor's delay of {sensor.delay:g} s is not shorter than the recording of "
            f"{signal.shape[-1] * interval:g} s; correct it under [sensors] in the actuator's TOML"
        )
    late = delayed(lagged(signal, interval, sensor.lag), interval, sensor.delay)
    shown = with_static_errors(late, sensor.scale, sensor.offset) + noise
    return np.asarray(np.abs(shown) if sensor.unsigned else shown)


def lagged(signal: Array, interval: float, lag: ArrayLike) -> Array:
    """Return a signal after a first-order lag, T dy/dt = x - y; exact for cubic x between the rows.

        y_n = e^{-h/T} y_{n-1} + ∫₀¹ (h/T) e^{-(1-s) h/T} x(t_{n-1} + s h) ds,   y_0 = x_0

    Parameters
    ----------
    signal : x, rows of instants or of interval means, shape (…, n)
    interval : h, between rows [s]
    lag : T ≥ 0, time constant, one number or one of each signal, shape (…,) [s]

    Returns
    -------
    y, in the unit of x, shape (…, n).

    Notes
    -----
    For a sine of angular frequency ω the relative error is at most 3/128 (ω h)⁴. The signal is assumed
    constant before its first row: a recording that starts in motion has errors during the first few T.
    """
    tau = np.asarray(lag, float)[..., np.newaxis] / interval
    if not np.any(tau > 0):
        return signal
    # Shorter lags have no effect within rounding.
    tau = np.maximum(tau, 1e-9)
    decay = np.exp(-1 / tau)
    weights = _moments(tau[..., 0], decay[..., 0]) @ LAGRANGE.T
    padded = _padded(signal, 2)
    rows = signal.shape[-1]
    result = sum(weights[..., k, np.newaxis] * padded[..., k : k + rows] for k in range(4))
    assert isinstance(result, np.ndarray)  # noqa: S101 - a sum of arrays
    result[..., 0] = signal[..., 0]
    # Σ_k decay^k u_{n-k} by doubling: each pass adds the sum of the previous 2^i rows to the sum of 2^i rows.
    reach = 1
    while reach < rows and np.any(decay**reach > NEGLIGIBLE):
        result[..., reach:] += decay**reach * result[..., :-reach]
        reach *= 2
    return np.asarray(result)


def delayed(signal: Array, interval: float, delay: ArrayLike) -> Array:
    """Return a signal after a pure delay, y(t) = x(t - d).

    Parameters
    ----------
    signal : x, rows of instants or of interval means, shape (…, n)
    interval : h, between rows [s]
    delay : d ≥ 0, one number or one of each signal, shape (…,) [s]

    Returns
    -------
    y, in the unit of x, shape (…, n); exact for cubic x, and for delays of whole multiples of h.
    """
    shift = np.asarray(delay, float)[..., np.newaxis] / interval
    if not np.any(shift > 0):
        return signal
    rows = signal.shape[-1]
    whole_rows = np.floor(shift)
    weights = _powers(1 - (shift - whole_rows))[..., 0, :] @ LAGRANGE.T
    first = np.arange(rows) - whole_rows.astype(np.intp)
    padded = _padded(signal, 2)
    result = np.zeros(np.broadcast_shapes(signal.shape, (*shift.shape[:-1], rows)))
    for k in range(4):
        column = np.broadcast_to(np.clip(first + k, 0, rows + 2), result.shape)
        taken = np.take_along_axis(np.broadcast_to(padded, (*result.shape[:-1], rows + 3)), column, axis=-1)
        result += weights[..., k, np.newaxis] * taken
    return result


def with_static_errors(signal: Array, scale: float, offset: float) -> Array:
    """Return the output of a sensor with errors of scale and zero: y = (1 + s) x + o.

    Parameters
    ----------
    signal : x, true signal
    scale : s > -1, relative error of the scale [-]
    offset : o, output at x = 0, in the unit of x
    """
    return (1 + scale) * signal + offset


def without_static_errors(shown: Array, scale: float, offset: float) -> Array:
    """Return the inverse of `with_static_errors`: x = (y - o) / (1 + s), with y = `shown`."""
    return (shown - offset) / (1 + scale)


def rounded(signal: Array, resolution: float) -> Array:
    """Return a signal rounded to whole counts of `resolution`; unchanged if `resolution` is 0."""
    return np.round(signal / resolution) * resolution if resolution else signal


def _padded(signal: Array, before: int) -> Array:
    """Return `signal` (…, n) with `before` copies of its first value in front and one value behind.

    The value behind is extrapolated by the parabola through the last three rows, of which the first are
    copies if the signal has only one row or two.
    """
    held = np.concatenate([np.repeat(signal[..., :1], before, axis=-1), signal], axis=-1)
    after = 3 * (held[..., -1:] - held[..., -2:-1]) + held[..., -3:-2]
    return np.concatenate([held, after], axis=-1)


def _powers(s: Array) -> Array:
    """Return 1, s, s², s³ along a new last axis."""
    return np.asarray(s[..., np.newaxis] ** np.arange(4))


def _moments(tau: Array, decay: Array) -> Array:
    """Return ∫₀¹ (1/τ) e^{-(1-s)/τ} s^k ds for k = 0 … 3 along a new last axis; `decay` is e^{-1/τ}.

    Integration by parts gives M_k = 1 - k τ M_{k-1}. For τ > 1 this has cancellation; there, Gauss's rule is
    exact to rounding.
    """
    nodes, weights = np.polynomial.legendre.leggauss(10)
    s = (1 + nodes) / 2
    kernel = np.exp(-(1 - s) / np.maximum(tau, 1.0)[..., np.newaxis]) / np.maximum(tau, 1.0)[..., np.newaxis]
    by_rule = (kernel * weights / 2) @ _powers(s)
    by_parts = [1 - decay]
    for k in range(1, 4):
        by_parts.append(1 - k * tau * by_parts[-1])
    return np.where((tau > 1.0)[..., np.newaxis], by_rule, np.stack(by_parts, axis=-1))
