"""Box of a search: its bounds, and the mapping of the unit cube to it."""

import numpy as np
from numpy.typing import ArrayLike

from emaphm.arrays import Array
from emaphm.errors import MethodError


def checked_box(lower: ArrayLike, upper: ArrayLike) -> tuple[Array, Array]:
    """Return read-only copies of the bounds, (d,) each; `MethodError` unless finite and lower < upper."""
    low, high = np.array(lower, float), np.array(upper, float)
    if low.ndim != 1 or low.shape != high.shape or not low.size:
        raise MethodError(
            f"bounds must be two vectors of one length, got shapes {low.shape} and {high.shape}"
        )
    for i in range(low.size):
        if not low[i] < high[i]:  # also refuses NaN
            raise MethodError(
                f"lower bound ({low[i]:g}) of component {i} must be less than upper bound ({high[i]:g})"
            )
        if not np.isfinite(high[i] - low[i]):
            raise MethodError(f"bounds of component {i} must be finite, got {low[i]:g} and {high[i]:g}")
    low.flags.writeable = False
    high.flags.writeable = False
    return low, high


def from_unit(unit: Array, lower: Array, upper: Array) -> Array:
    """Return points (n, d) of the unit cube mapped to the box; clipped because of rounding at the bounds."""
    return np.clip(lower + (upper - lower) * unit, lower, upper)
