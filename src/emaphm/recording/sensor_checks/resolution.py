"""How finely a sensor resolves its quantity: the step of its counts, and its noise."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array

Mask: TypeAlias = NDArray[np.bool_]
"""Whether each row of a channel is spoilt."""

SCATTER_OF_NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""


def step_of_counts(values: Array) -> float:
    """Return the least distance between different values, (n,): the count of a converter, rounding else."""
    distances = np.diff(np.unique(values))
    smallest = np.finfo(float).eps * float(np.max(np.abs(values), initial=0.0))
    real = distances[distances > 4 * smallest]
    return float(real.min()) if real.size else 0.0


def row_noise(values: Array) -> float:
    """Return the rms of what changes from row to row without a trend: noise, ripple, rounding.

    By the median of third differences, whose variance is 20 times that of white noise: rows that were held,
    jumps and corners are few.
    """
    third = np.diff(values, 3)
    return SCATTER_OF_NORMAL * float(np.median(np.abs(third))) / 20**0.5 if third.size else 0.0


def runs_of_equal(values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first rows and the lengths of all runs of equal values in `values` (n,)."""
    changes = np.flatnonzero(np.diff(values) != 0) + 1
    first = np.concatenate([[0], changes])
    return first, np.diff(np.concatenate([first, [values.size]]))
