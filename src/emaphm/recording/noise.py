"""The white noise on a channel, and the steps that it is recorded in, by its own rows."""

import math

import numpy as np

from emaphm.arrays import Array

SLOW_ROWS_S = 2e-3
"""Rows farther apart than this pass over the current's jumps where friction reverses [s]: the rms of second
differences shows those jumps, 0.2 to 0.6 A of the thesis's actuator where the noise was 0.05 A."""

NORMAL_QUARTILE = 0.6744897501960817
"""Median magnitude of a standard normal number."""

SAME_COUNT = 1e-9
"""Distance of two values, relative to their column's range, below which they are the same count: values of
one count may differ by the rounding of the file."""


def noise_level(values: Array) -> float:
    """Return the rms of the white noise on a smooth signal `values` (n,), in its unit.

    From its second differences, whose variance is 6 times that of white noise, and next to nothing of a
    signal that is smooth over three rows.
    """
    return float(np.sqrt(np.mean(np.diff(values, 2) ** 2) / 6))


def robust_noise_level(values: Array, order: int) -> float:
    """Return the rms of the white noise on a smooth signal (n,), whatever a minority of its rows shows.

    From the median magnitude of its differences of that `order` m, whose variance is (2m)!/(m!)² times that
    of white noise: what was held, jumps, corners and spikes are in few rows. A higher order leaves less of a
    signal that is not smooth. 0 where the rows are too few.
    """
    differences = np.diff(values, order)
    if not differences.size:
        return 0.0
    return float(np.median(np.abs(differences))) / (NORMAL_QUARTILE * math.sqrt(math.comb(2 * order, order)))


def noise_on_most_rows(values: Array) -> float:
    """Return the rms of the noise on most of the rows `values` (n,).

    By second or fourth differences, whichever shows less: jumps are in some rows, noise is in all.
    """
    return min(robust_noise_level(values, 2), robust_noise_level(values, 4))


def measured_noise(values: Array, interval: float) -> float:
    """Return the rms of the white noise on a channel `values` (n,), whose rows are `interval` [s] apart.

    That of all rows (`noise_level`); of slow rows, on which a current's jumps would pass for noise, that on
    most of them where it is less.
    """
    level = noise_level(values)
    return level if interval <= SLOW_ROWS_S else min(level, noise_on_most_rows(values))


def smallest_step(values: Array, same: float) -> float:
    """Return the smallest distance of two values (n,) that is above `same`, in their unit; 0 without any."""
    steps = np.diff(np.unique(values))
    steps = steps[steps > same]
    return float(steps.min()) if steps.size else 0.0


def rounding_step(values: Array) -> float:
    """Return the step that a column (n,) is rounded to: the smallest distance between two of its values."""
    return smallest_step(values, SAME_COUNT * float(np.ptp(values))) if values.size else 0.0
