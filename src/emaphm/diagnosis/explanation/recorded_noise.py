"""What of a recorded channel is noise and rounding: by its own rows, whatever a minority of them shows."""

import numpy as np

from emaphm.arrays import Array

NORMAL_QUARTILE = 0.6744897501960817
"""Median magnitude of a standard normal number."""

SAME_COUNT = 1e-9
"""Distance of two values, relative to their column's range, below which they are the same count."""


def robust_noise_level(values: Array) -> float:
    """Return the rms of the white noise on a smooth signal (n,), whatever a minority of its rows shows.

    From the median magnitude of its second differences, whose variance is 6 times that of white noise: spikes
    and jumps are no noise.
    """
    return float(np.median(np.abs(np.diff(values, 2))) / (NORMAL_QUARTILE * 6**0.5))


def rounding_step(values: Array) -> float:
    """Return the step that a column (n,) is rounded to: the smallest distance between two of its values."""
    steps = np.diff(np.unique(values))
    # Values of one count may differ by the rounding of the file.
    steps = steps[steps > SAME_COUNT * np.ptp(values)] if steps.size else steps
    return float(steps.min()) if steps.size else 0.0


def usual_variance(values: Array) -> float:
    """Return the variance of noise and rounding of most rows of a column (n,), in the square of its unit."""
    return robust_noise_level(values) ** 2 + rounding_step(values) ** 2 / 12
