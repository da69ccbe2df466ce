"""How large a recorded signal is: what residuals are measured against."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array, rms

POSITIONS = ("position_rad", "angle_rad")
"""Channels whose zero is anywhere: half a radian away from it, 5 % of the rms are more than a manoeuvre."""


def signal_size(name: str, values: Array) -> float:
    """Return the rms of channel `name` (samples,), of a position that of the distance from its first row."""
    return rms(values - values[0]) if name in POSITIONS else rms(values)


def row_sizes(channels: Sequence[str], rows: NDArray[np.floating[Any]]) -> Array:
    """Return the same of many recordings' `rows` (n, channels, samples), (n, channels)."""
    counted = np.array([name in POSITIONS for name in channels])[:, np.newaxis]
    moved = rows - np.where(counted, rows[..., :1], 0)
    return np.asarray(np.sqrt(np.mean(moved**2, axis=-1)), float)
