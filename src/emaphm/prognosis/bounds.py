"""Bounds of the levels of the components."""

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.actuator.requirements import LOWEST_FRICTION
from emaphm.arrays import Array
from emaphm.prognosis.columns import ECCENTRICITY

COORDINATES = len(CARTESIAN_NAMES)
"""Number of coordinates of the fault vector in an estimate; an indicator has one."""

LOWEST = np.array([LOWEST_FRICTION, 0.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0])
HIGHEST = np.ones(COORDINATES)
"""Bounds of the levels, in the order of `CARTESIAN_NAMES`; an eccentricity is limited by its circle. Friction
may be below that of a new unit, down to the limit of the actuator."""

HEALTHY_AT_LOWEST = (1, 2, 3, 4)
"""Columns of the components whose lowest level is the healthy level and not a fault."""


BEYOND = 0.1
"""Largest distance of a current level beyond the end of its scale. A diagnosis searches up to the end only,
and a component found there may be worse. No diagnosis supports a larger distance."""


def bounds(count: int, beyond: float = 0.0, least_friction: float = LOWEST_FRICTION) -> tuple[Array, Array]:
    """Return the lower and upper bounds (count,) of all components, or of an indicator (0 when healthy).

    Ends of scales at which a component is at its worst are moved outwards by `beyond`. `least_friction` is
    the lower bound of the actuator's friction (`emaphm.actuator.faults.lower_bounds`).
    """
    low, high = (LOWEST.copy(), HIGHEST) if count == COORDINATES else (np.zeros(count), np.ones(count))
    if count == COORDINATES:
        low[0] = least_friction
    return low - beyond * _worst_at_lowest(count), high + beyond


def within_bounds(level: Array, beyond: float = 0.0, least_friction: float = LOWEST_FRICTION) -> Array:
    """Return levels (…, 8) clipped to their `bounds`, an eccentricity to its circle."""
    clipped = np.clip(level, *bounds(level.shape[-1], beyond, least_friction))
    if level.shape[-1] < COORDINATES:
        return clipped
    x, y = ECCENTRICITY
    radius = np.maximum(np.hypot(clipped[..., x], clipped[..., y]) / (1.0 + beyond), 1.0)
    clipped[..., x] /= radius
    clipped[..., y] /= radius
    return clipped


def to_the_end(level: Array, least_friction: float = LOWEST_FRICTION) -> Array:
    """Return the distances (…, 8) of levels from the end of their scales, 0 at or beyond the end.

    If both ends are faults, the distance is to the nearer end; for an eccentricity, to its circle.
    """
    count = level.shape[-1]
    low, high = bounds(count, least_friction=least_friction)
    distance = high - level
    if count == COORDINATES:
        distance = np.where(_worst_at_lowest(count), np.minimum(distance, level - low), distance)
        x, y = ECCENTRICITY
        distance[..., x] = distance[..., y] = 1.0 - np.hypot(level[..., x], level[..., y])
    return np.maximum(distance, 0.0)


def _worst_at_lowest(count: int) -> NDArray[np.bool_]:
    """Return a mask (count,): True if the lower end of the level is a fault and not the healthy level."""
    result = np.full(count, count == COORDINATES)
    if count == COORDINATES:
        result[list(HEALTHY_AT_LOWEST)] = False
    return result
