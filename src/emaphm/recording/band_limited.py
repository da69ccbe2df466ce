"""Interpolation of a smooth signal with few rows per cycle by a spline of degree five."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array

DEGREE = 5
"""Degree of the spline; its error falls with the sixth power of the frequency."""


@dataclass(frozen=True)
class SmoothnessSettings:
    """Thresholds on differences of the rows, between which a signal is smooth with few rows per cycle.

    For a sine of angular frequency w in rows at an interval h, fourth differences are q = (2 sin(w h / 2))²
    times the second differences. `fewest` is the q of 28 rows per cycle: with more rows, the error of Akima's
    curve is below 1e-4 of the signal. `most` is the q of four rows per cycle. A jump has q = 3.2 and white
    noise 2.9: a spline rings there, Akima's curve does not. A bend, where the slope jumps, has q = 1.4 to
    2.5, which depends on its place within the row: a signal has a bend where the curvature of three rows is
    `bend` times as large as that of the two rows before and the two rows after them, and as three times the
    median.
    """

    fewest: float = 0.05
    most: float = 2.0
    bend: float = 10.0


SMOOTHNESS = SmoothnessSettings()


def is_band_limited(values: Array) -> bool:
    """Return whether `values` (n,) are a smooth signal with few rows per cycle, according to `SMOOTHNESS`."""
    if values.size < 2 * DEGREE or not SMOOTHNESS.fewest <= _difference_ratio(values) <= SMOOTHNESS.most:
        return False
    return not _has_bend(values)


def is_well_sampled(values: Array) -> bool:
    """Return whether `values` (n,) are smooth, with enough rows per cycle for any curve to fit them."""
    return _difference_ratio(values) < SMOOTHNESS.fewest


def _has_bend(values: Array) -> bool:
    """Return whether the slope of `values` (n,) jumps, such as where a ramp or a sine begins after a rest.

    A bend shows in three second differences of means over intervals, in two of instants.
    """
    curvature = np.abs(np.diff(values, 2))
    sums = np.cumsum(np.pad(curvature, (3, 2)))
    bend, around = sums[5:-2] - sums[2:-5], sums[7:] - sums[:-7]
    around = around - bend
    least = SMOOTHNESS.bend * np.maximum(around, 3 * float(np.median(curvature)))
    return bool(np.any(bend > least))


def _difference_ratio(values: Array) -> float:
    """Return the rms of the fourth differences over that of the second differences, 0 without curvature."""
    curvature = float(np.mean(np.diff(values, 2) ** 2))
    fourth = float(np.mean(np.diff(values, 4) ** 2))
    return (fourth / curvature) ** 0.5 if curvature > 0 else 0.0


def spline_through(values: Array, interval: float, degree: int = DEGREE) -> Callable[[Array], Array]:
    """Return the spline of `degree` through `values` (n,) at i × interval, as a function of time [s]."""
    from scipy.interpolate import make_interp_spline

    return _as_function(make_interp_spline(np.arange(values.size) * interval, values, k=degree))


def spline_of_means(values: Array, interval: float, degree: int = DEGREE) -> Callable[[Array], Array]:
    """Return the curve whose means over [i h, (i + 1) h), h the interval, are `values` (n,).

    It is a histospline: the derivative of the spline of the given `degree` through the running sums of the
    means.
    """
    from scipy.interpolate import make_interp_spline

    mean = float(np.mean(values))
    sums = interval * np.concatenate([[0.0], np.cumsum(values - mean)])
    integral = make_interp_spline(np.arange(sums.size) * interval, sums, k=degree)
    derivative = _as_function(integral.derivative())
    return lambda times: derivative(times) + mean


def _as_function(spline: Callable[[Array], Array]) -> Callable[[Array], Array]:
    return lambda times: np.asarray(spline(times), float)
