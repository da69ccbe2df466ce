"""The noise and the steps of a recorded channel, by its own rows, whatever a minority of them shows."""

import math

import numpy as np

from emaphm.arrays import Array

SLOW_ROWS_S = 2e-3
"""Rows farther apart than this pass over the current's jumps where friction reverses [s]: the rms of second
differences shows those jumps, 0.2 to 0.6 A of the thesis's actuator where the noise was 0.05 A."""

NORMAL_QUARTILE = 0.6744897501960817
"""Median magnitude of a standard normal number."""


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


def quiet_noise_level(values: Array, interval: float) -> float:
    """Return the noise on most of the rows `values` (n,), `interval` [s] apart; inf of dense rows."""
    return math.inf if interval <= SLOW_ROWS_S else noise_on_most_rows(values)


def smallest_step(values: Array, same: float) -> float:
    """Return the smallest distance of two values (n,) that is above `same`, in their unit; 0 without any."""
    steps = np.diff(np.unique(values))
    steps = steps[steps > same]
    return float(steps.min()) if steps.size else 0.0
