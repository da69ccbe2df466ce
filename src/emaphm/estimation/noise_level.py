"""The white noise on a smooth signal."""

import numpy as np

from emaphm.arrays import Array


def noise_level(values: Array) -> float:
    """Return the rms of the white noise on a smooth signal `values` (n,), in its unit.

    From its second differences, whose variance is 6 times that of white noise, and next to nothing of a
    signal that is smooth over three rows.
    """
    return float(np.sqrt(np.mean(np.diff(values, 2) ** 2) / 6))
