"""Within which bounds the levels of components are."""

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.actuator.requirements import LOWEST_FRICTION
from emaphm.arrays import Array
from emaphm.prognosis.columns import ECCENTRICITY

COORDINATES = len(CARTESIAN_NAMES)
"""Of the fault vector as estimators see it; an indicator has one."""

LOWEST = np.array([LOWEST_FRICTION, 0.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0])
HIGHEST = np.ones(COORDINATES)
"""Bounds of the levels, in the order of `CARTESIAN_NAMES`; an eccentricity is within its circle. A friction
may be below that of a new unit, by as much as its actuator allows."""

HEALTHY_AT_LOWEST = (1, 2, 3, 4)
"""Components whose lowest level is the healthy one, not an end of the scale where they are at their worst."""


BEYOND = 0.1
"""How far beyond the end of its scale a level may be now. A diagnosis looks no farther than to the end, but a
component that it finds there may be worse; what is known of no diagnosis is not taken to be far beyond."""


def bounds(count: int, beyond: float = 0.0, least_friction: float = LOWEST_FRICTION) -> tuple[Array, Array]:
    """Return the bounds (count,) of all components, or of an indicator, which is 0 where it is healthy.

    Ends of scales at which a component is at its worst are farther off by `beyond`. `least_friction` is that
    of the actuator (`emaphm.actuator.faults.lower_bounds`).
    """
    low, high = (LOWEST.copy(), HIGHEST) if count == COORDINATES else (np.zeros(count), np.ones(count))
    if count == COORDINATES:
        low[0] = least_friction
    return low - beyond * _worst_at_lowest(count), high + beyond


def within_bounds(level: Array, beyond: float = 0.0, least_friction: float = LOWEST_FRICTION) -> Array:
    """Return levels (…, 8) put within their `bounds`, an eccentricity within its circle."""
    clipped = np.clip(level, *bounds(level.shape[-1], beyond, least_friction))
    if level.shape[-1] < COORDINATES:
        return clipped
    x, y = ECCENTRICITY
    radius = np.maximum(np.hypot(clipped[..., x], clipped[..., y]) / (1.0 + beyond), 1.0)
    clipped[..., x] /= radius
    clipped[..., y] /= radius
    return clipped


def to_the_end(level: Array, least_friction: float = LOWEST_FRICTION) -> Array:
    """Return how far levels (…, 8) are from the end of the scale, 0 where they are at it or beyond.

    The nearer end, where both are at a fault; of an eccentricity, its circle.
    """
    count = level.shape[-1]
    low, high = bounds(count, least_friction=least_friction)
    far = high - level
    if count == COORDINATES:
        far = np.where(_worst_at_lowest(count), np.minimum(far, level - low), far)
        x, y = ECCENTRICITY
        far[..., x] = far[..., y] = 1.0 - np.hypot(level[..., x], level[..., y])
    return np.maximum(far, 0.0)


def _worst_at_lowest(count: int) -> NDArray[np.bool_]:
    """Return of which of `count` levels the lower end is a fault too, not the healthy one."""
    result = np.full(count, count == COORDINATES)
    if count == COORDINATES:
        result[list(HEALTHY_AT_LOWEST)] = False
    return result
