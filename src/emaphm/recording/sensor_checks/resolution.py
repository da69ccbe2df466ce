"""Resolution of a sensor: the step of its converter counts, its noise, and runs of equal values."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.recording.noise import robust_noise_level, rounding_step, smallest_step

Mask: TypeAlias = NDArray[np.bool_]
"""One truth value for each row of a channel, (samples,)."""

LEAST_REPEATED = 4
"""Least number of different repeated values that show a grid: fewer values may lie on one by chance."""

ON_GRID = 0.01
"""Largest distance of a repeated value from a grid [steps of the grid]."""

BETWEEN_COUNTS = 1e-3
"""Smallest distance of values that shows interpolation, in steps of the grid of the repeated values."""


def step_of_counts(values: Array) -> float:
    """Return the least distance between different `values` (n,): a converter's count, or the rounding."""
    return smallest_step(values, 4 * np.finfo(float).eps * float(np.max(np.abs(values), initial=0.0)))


def step_of_repeats(values: Array) -> float:
    """Return the step of counts of `values` (n,) that were interpolated between rows with jittering times.

    An interpolated value lies between two counts, except where the rows about it have the same count: it then
    repeats that count. The step is the grid of the repeated values, or that of all values (`step_of_counts`)
    if the repeated values are on no grid.
    """
    step = step_of_counts(values)
    repeated = np.unique(values[1:][np.diff(values) == 0])
    grid = rounding_step(repeated)
    if repeated.size < LEAST_REPEATED or step > BETWEEN_COUNTS * grid:
        return step
    levels = (repeated - repeated[0]) / grid
    return grid if np.max(np.abs(levels - np.round(levels))) <= ON_GRID else step


def row_noise(values: Array) -> float:
    """Return the rms of the changes between rows of `values` (n,) without trend: noise, ripple, rounding."""
    return robust_noise_level(values, 3)


def runs_of_equal(values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first row and the length of each run of equal values in `values` (n,)."""
    changes = np.flatnonzero(np.diff(values) != 0) + 1
    first = np.concatenate([[0], changes])
    return first, np.diff(np.concatenate([first, [values.size]]))
