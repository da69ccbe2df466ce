"""The noise on slow rows, which pass over the jumps of a signal: taken from the rows between the jumps."""

import math

import numpy as np

from emaphm.arrays import Array

SLOW_ROWS_S = 2e-3
"""Rows farther apart than this pass over the current's jumps where friction reverses [s]: the rms of second
differences shows those jumps, 0.2 to 0.6 A of the thesis's actuator where the noise was 0.05 A."""

NORMAL_MEDIAN = 0.6745
"""Median of the magnitude of normal deviates, relative to their rms."""


def quiet_noise_level(values: Array, interval: float) -> float:
    """Return the rms of the noise on most of the rows `values` (n,), `interval` [s] apart; inf of dense rows.

    From the median magnitude of second or fourth differences, whose variances are 6 and 70 times that of
    white noise, whichever shows less: jumps are in some rows, noise is in all.
    """
    if interval <= SLOW_ROWS_S:
        return math.inf
    second, fourth = (float(np.median(np.abs(np.diff(values, n)))) for n in (2, 4))
    return min(second / math.sqrt(6), fourth / math.sqrt(70)) / NORMAL_MEDIAN
