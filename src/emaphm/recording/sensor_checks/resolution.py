"""Resolution of a sensor: the step of its converter counts, its noise, and runs of equal values."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.recording.noise import robust_noise_level, smallest_step

Mask: TypeAlias = NDArray[np.bool_]
"""One truth value for each row of a channel, (samples,)."""


def step_of_counts(values: Array) -> float:
    """Return the least distance between different `values` (n,): a converter's count, or the rounding."""
    return smallest_step(values, 4 * np.finfo(float).eps * float(np.max(np.abs(values), initial=0.0)))


def row_noise(values: Array) -> float:
    """Return the rms of the changes between rows of `values` (n,) without trend: noise, ripple, rounding."""
    return robust_noise_level(values, 3)


def runs_of_equal(values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first row and the length of each run of equal values in `values` (n,)."""
    changes = np.flatnonzero(np.diff(values) != 0) + 1
    first = np.concatenate([[0], changes])
    return first, np.diff(np.concatenate([first, [values.size]]))
