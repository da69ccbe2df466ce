"""Check for channels in another unit than the healthy cycles: no fault changes a size by a factor of 1000."""

import math
from collections.abc import Sequence

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import RecordingError

SAME_SHAPE = 0.95
"""Least uncentred correlation of a channel with its healthy mean: a fault of this size changes the shape."""

WITHIN = 2.0
"""Largest further ratio, in either direction, by which a fault and the load may change a channel."""

FACTORS = {"a thousandth of the unit": 1e3, "thousands of the unit": 1e-3}
"""Apparent unit of a channel, and the factor by which its values are larger."""

ANGLE_FACTORS = {"degrees": 180 / math.pi}
"""The same for angles and their speeds, which are in radians in healthy cycles."""

ANGLES = ("position_rad", "speed_rad_s", "angle_rad")


def check_units(source: str, signals: Sequence[Array], mean: Array, channels: Sequence[str]) -> None:
    """Raise an error for cycles with a channel in another unit.

    The ratio of a channel y to its healthy mean m is |Σ y m| / Σ m², over the rows that the cycles have.

    Parameters
    ----------
    source
        Name of the recording, for the message.
    signals
        Measured channels of each cycle, (rows, channels); NaN in missing rows.
    mean
        Healthy mean, (rows, channels).
    channels
        Names of the channels.

    Raises
    ------
    RecordingError
        A channel has the shape of the healthy one, and its size differs by the factor between two units.
    """
    for k, name in enumerate(channels):
        measured = np.concatenate([cycle[:, k] for cycle in signals])
        healthy = np.tile(mean[:, k], len(signals))
        known = np.isfinite(measured)
        unit = _other_unit(name, measured[known], healthy[known])
        if unit is not None:
            raise RecordingError(
                f"{source}: {name} has the shape of the healthy one, but seems to be in {unit[0]}: it is "
                f"{unit[1]:.4g} times as large; convert it, or state its unit under [channels] for both"
            )


def _other_unit(name: str, measured: Array, healthy: Array) -> tuple[str, float] | None:
    """Return the apparent unit of a channel and its ratio to the healthy size; None for the same unit."""
    sizes = float(np.linalg.norm(measured)), float(np.linalg.norm(healthy))
    if not all(sizes):
        return None
    product = float(measured @ healthy)
    if abs(product) < SAME_SHAPE * sizes[0] * sizes[1]:
        return None
    ratio = abs(product) / sizes[1] ** 2
    factors = FACTORS | (ANGLE_FACTORS if name in ANGLES else {})
    for unit, factor in factors.items():
        if 1 / WITHIN <= ratio / factor <= WITHIN:
            return unit, ratio
    return None
