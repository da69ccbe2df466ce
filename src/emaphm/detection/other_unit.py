"""A channel in another unit than that of the healthy cycles: no fault makes it a thousand times as large."""

import math
from collections.abc import Sequence

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import RecordingError

SAME_SHAPE = 0.95
"""Least correlation, about 0, of a channel and its healthy mean: a fault that strong bends the shape too."""

WITHIN = 2.0
"""Ratio to a factor between units that a fault and the load may make in addition."""

FACTORS = {"a thousandth of the unit": 1e3, "thousands of the unit": 1e-3}
"""How much larger a channel looks, by the unit it seems to be in."""

ANGLE_FACTORS = {"degrees": 180 / math.pi}
"""The same, of angles and their speeds where healthy ones are in radians."""

ANGLES = ("position_rad", "speed_rad_s", "angle_rad")


def check_units(source: str, signals: Sequence[Array], mean: Array, channels: Sequence[str]) -> None:
    """Refuse cycles with a channel in another unit.

    The ratio of a channel y to its healthy mean m is Σ y m / Σ m², over the rows that the cycles have.

    Parameters
    ----------
    source
        Where the cycles come from, for the message.
    signals
        Of each cycle, (rows, channels), as measured; NaN where a row is missing.
    mean
        The healthy mean, (rows, channels).
    channels
        Their names.

    Raises
    ------
    RecordingError
        A channel has the shape of the healthy one, and is larger by the factor between two units.
    """
    for k, name in enumerate(channels):
        measured = np.concatenate([one[:, k] for one in signals])
        healthy = np.tile(mean[:, k], len(signals))
        known = np.isfinite(measured)
        unit = _other_unit(name, measured[known], healthy[known])
        if unit is not None:
            raise RecordingError(
                f"{source}: {name} has the shape of the healthy one, but seems to be in {unit[0]}: it is "
                f"{unit[1]:.4g} times as large; convert it, or state its unit under [channels] for both"
            )


def _other_unit(name: str, measured: Array, healthy: Array) -> tuple[str, float] | None:
    """Return the unit that a channel seems to be in and how many times as large it is, or None."""
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
