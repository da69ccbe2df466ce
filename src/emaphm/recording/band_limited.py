"""A curve through few rows a cycle, where the signal behind them is smooth: a spline of degree five."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array

DEGREE = 5
"""Of the spline; its error falls with the sixth power of the frequency."""


@dataclass(frozen=True)
class SmoothnessSettings:
    """From which curvature on rows are few a cycle, and up to which they still show a smooth signal.

    Of a sine of angular frequency w in rows h apart, fourth differences are q = (2 sin(w h / 2))² times the
    second ones. `fewest` is 28 rows a cycle: with more, Akima's curve is right to 1e-4 of the signal. `most`
    is four rows a cycle. Behind a jump q is 3.2, behind white noise 2.9: a spline rings there, Akima's curve
    does not. Behind a bend of the slope q is 1.4 to 2.5, by where in its row it lies: a signal bends where
    the curvature of three rows is `bend` times as large as that of two rows before and two after them, and as
    three times the median one.
    """

    fewest: float = 0.05
    most: float = 2.0
    bend: float = 10.0


SMOOTHNESS = SmoothnessSettings()


def is_band_limited(values: Array) -> bool:
    """Return whether `values` (n,) are few rows a cycle of a smooth signal, by `SMOOTHNESS`."""
    if values.size < 2 * DEGREE or not SMOOTHNESS.fewest <= _ratio(values) <= SMOOTHNESS.most:
        return False
    return not _bends(values)


def is_well_sampled(values: Array) -> bool:
    """Return whether `values` (n,) are more rows a cycle of a smooth signal than any curve needs."""
    return _ratio(values) < SMOOTHNESS.fewest


def _bends(values: Array) -> bool:
    """Return whether the slope of `values` (n,) jumps, as where a ramp or a sine begins after a rest.

    Means over intervals have a bend in three second differences, instants in two.
    """
    curvature = np.abs(np.diff(values, 2))
    sums = np.cumsum(np.pad(curvature, (3, 2)))
    bend, around = sums[5:-2] - sums[2:-5], sums[7:] - sums[:-7]
    around = around - bend
    least = SMOOTHNESS.bend * np.maximum(around, 3 * float(np.median(curvature)))
    return bool(np.any(bend > least))


def _ratio(values: Array) -> float:
    """Return the rms of the fourth differences over that of the second ones, 0 without any curvature."""
    curvature = float(np.mean(np.diff(values, 2) ** 2))
    fourth = float(np.mean(np.diff(values, 4) ** 2))
    return (fourth / curvature) ** 0.5 if curvature > 0 else 0.0


def spline_through(values: Array, interval: float, degree: int = DEGREE) -> Callable[[Array], Array]:
    """Return the spline of a `degree` through `values` (n,) at i × interval, as a function of time [s]."""
    from scipy.interpolate import make_interp_spline

    return _as_function(make_interp_spline(np.arange(values.size) * interval, values, k=degree))


def spline_of_means(values: Array, interval: float, degree: int = DEGREE) -> Callable[[Array], Array]:
    """Return the curve whose means over [i h, (i + 1) h), h the interval, are `values` (n,).

    The derivative of the spline of a `degree` through the running sums of the means: a histospline.
    """
    from scipy.interpolate import make_interp_spline

    mean = float(np.mean(values))
    sums = interval * np.concatenate([[0.0], np.cumsum(values - mean)])
    integral = make_interp_spline(np.arange(sums.size) * interval, sums, k=degree)
    derivative = _as_function(integral.derivative())
    return lambda times: derivative(times) + mean


def _as_function(spline: Callable[[Array], Array]) -> Callable[[Array], Array]:
    return lambda times: np.asarray(spline(times), float)
