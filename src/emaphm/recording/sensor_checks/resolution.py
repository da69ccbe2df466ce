"""How finely a sensor resolves its quantity: the step of its counts, its noise, and runs of equal values."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.recording.noise import robust_noise_level, smallest_step

Mask: TypeAlias = NDArray[np.bool_]
"""Whether each row of a channel is spoilt."""


def step_of_counts(values: Array) -> float:
    """Return the least distance between different values, (n,): the count of a converter, rounding else."""
    return smallest_step(values, 4 * np.finfo(float).eps * float(np.max(np.abs(values), initial=0.0)))


def row_noise(values: Array) -> float:
    """Return the rms of what changes from row to row without a trend: noise, ripple, rounding."""
    return robust_noise_level(values, 3)


def runs_of_equal(values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first rows and the lengths of all runs of equal values in `values` (n,)."""
    changes = np.flatnonzero(np.diff(values) != 0) + 1
    first = np.concatenate([[0], changes])
    return first, np.diff(np.concatenate([first, [values.size]]))
