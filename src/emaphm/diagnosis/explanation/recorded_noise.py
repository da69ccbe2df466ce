"""What of a recorded channel is noise and rounding: by its own rows, whatever a minority of them shows."""

import numpy as np

from emaphm.arrays import Array
from emaphm.recording.noise import robust_noise_level, smallest_step

SAME_COUNT = 1e-9
"""Distance of two values, relative to their column's range, below which they are the same count: values of
one count may differ by the rounding of the file."""


def usual_noise(values: Array) -> float:
    """Return the rms of the white noise on most rows of a column (n,), in its unit."""
    return robust_noise_level(values, 2)


def rounding_step(values: Array) -> float:
    """Return the step that a column (n,) is rounded to: the smallest distance between two of its values."""
    return smallest_step(values, SAME_COUNT * float(np.ptp(values))) if values.size else 0.0


def usual_variance(values: Array) -> float:
    """Return the variance of noise and rounding of most rows of a column (n,), in the square of its unit."""
    return usual_noise(values) ** 2 + rounding_step(values) ** 2 / 12
