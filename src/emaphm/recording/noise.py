"""Estimates of a channel's white noise and of its quantisation step from its own rows."""

import math

import numpy as np

from emaphm.arrays import Array

SLOW_ROWS_S = 2e-3
"""Interval [s] above which the jumps of the current at friction reversals lie between two rows: the rms of
second differences then measures these jumps, 0.2 to 0.6 A for the thesis's actuator with a noise of 0.05
A."""

NORMAL_QUARTILE = 0.6744897501960817
"""Median magnitude of a standard normal number."""

SAME_COUNT = 1e-9
"""Distance of two values, relative to their column's range, below which they are the same converter count:
values of one count may differ by the rounding of the file."""


def noise_level(values: Array) -> float:
    """Return the rms of the white noise on a smooth signal `values` (n,), in its unit.

    It is computed from second differences. Their variance is 6 times that of white noise, and nearly 0 for a
    signal that is smooth over three rows.
    """
    return float(np.sqrt(np.mean(np.diff(values, 2) ** 2) / 6))


def robust_noise_level(values: Array, order: int) -> float:
    """Return the rms of the white noise on a smooth signal (n,), robust to outliers in a minority of rows.

    It is computed from the median magnitude of the differences of `order` m, whose variance is (2m)!/(m!)²
    times that of white noise: held values, jumps, corners and spikes are in few rows. A higher order removes
    more of the signal itself. 0 if there are too few rows.
    """
    differences = np.diff(values, order)
    if not differences.size:
        return 0.0
    return float(np.median(np.abs(differences))) / (NORMAL_QUARTILE * math.sqrt(math.comb(2 * order, order)))


def noise_on_most_rows(values: Array) -> float:
    """Return the rms of the noise on most of the rows `values` (n,).

    The smaller of the estimates from second and fourth differences: jumps are in some rows, noise is in all
    rows.
    """
    return min(robust_noise_level(values, 2), robust_noise_level(values, 4))


def measured_noise(values: Array, interval: float) -> float:
    """Return the rms of the white noise on a channel `values` (n,) with rows at an `interval` [s].

    It is estimated from all rows (`noise_level`). Slow rows would count jumps of the current as noise: there
    the estimate from most rows (`noise_on_most_rows`) is used if it is smaller.
    """
    level = noise_level(values)
    return level if interval <= SLOW_ROWS_S else min(level, noise_on_most_rows(values))


def smallest_step(values: Array, same: float) -> float:
    """Return the smallest distance between two `values` (n,) that exceeds `same`, in their unit, else 0."""
    steps = np.diff(np.unique(values))
    steps = steps[steps > same]
    return float(steps.min()) if steps.size else 0.0


def rounding_step(values: Array) -> float:
    """Return the step to which a column (n,) is rounded: the smallest distance between two of its values."""
    return smallest_step(values, SAME_COUNT * float(np.ptp(values))) if values.size else 0.0
