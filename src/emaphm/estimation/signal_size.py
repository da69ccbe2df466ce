"""Size of a recorded signal: the reference that residuals are related to."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array, rms

POSITIONS = ("position_rad", "angle_rad")
"""Channels with an arbitrary zero: half a radian away from it, 5 % of the rms are more than a manoeuvre."""


def signal_size(name: str, values: Array) -> float:
    """Return the rms of channel `name` (samples,); for a position, the rms distance from its first row."""
    return rms(values - values[0]) if name in POSITIONS else rms(values)


def row_sizes(channels: Sequence[str], rows: NDArray[np.floating[Any]]) -> Array:
    """Return the signal sizes (n, channels) of the `rows` (n, channels, samples) of n recordings."""
    is_position = np.array([name in POSITIONS for name in channels])[:, np.newaxis]
    distances = rows - np.where(is_position, rows[..., :1], 0)
    return np.asarray(np.sqrt(np.mean(distances**2, axis=-1)), float)
