"""Within which bounds the levels of components are."""

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.actuator.requirements import LOWEST_FRICTION
from emaphm.arrays import Array
from emaphm.prognosis.columns import ECCENTRICITY

COMPONENTS = len(CARTESIAN_NAMES)

LOWEST = np.array([LOWEST_FRICTION, 0.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0])
HIGHEST = np.ones(COMPONENTS)
"""Bounds of the levels, in the order of `CARTESIAN_NAMES`; an eccentricity is within its circle. A friction
may be below that of a new unit."""

HEALTHY_AT_LOWEST = (1, 2, 3, 4)
"""Components whose lowest level is the healthy one, not an end of the scale where they are at their worst."""


def bounds(count: int) -> tuple[Array, Array]:
    """Return the bounds of `count` levels: of all components, or of an indicator, 0 where it is healthy."""
    return (LOWEST, HIGHEST) if count == COMPONENTS else (np.zeros(count), np.ones(count))


def within_bounds(level: Array) -> Array:
    """Return levels (…, 8) put within their bounds, an eccentricity within its circle."""
    clipped = np.clip(level, *bounds(level.shape[-1]))
    if level.shape[-1] < COMPONENTS:
        return clipped
    x, y = ECCENTRICITY
    radius = np.maximum(np.hypot(clipped[..., x], clipped[..., y]), 1.0)
    clipped[..., x] /= radius
    clipped[..., y] /= radius
    return clipped


def to_the_end(level: Array) -> Array:
    """Return how far levels (8,) are from the end of the scale, (8,), 0 where they are at it or beyond.

    The nearer end, where both are at a fault; of an eccentricity, its circle.
    """
    low, high = bounds(level.size)
    if level.size < COMPONENTS:
        return np.maximum(high - level, 0.0)
    both = np.minimum(high - level, level - low)
    both[list(HEALTHY_AT_LOWEST)] = (high - level)[list(HEALTHY_AT_LOWEST)]
    both[list(ECCENTRICITY)] = 1.0 - np.hypot(*level[list(ECCENTRICITY)])
    return np.maximum(both, 0.0)
