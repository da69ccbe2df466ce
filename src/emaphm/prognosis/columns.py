"""Which columns a component has in levels of the coordinates `CARTESIAN_NAMES`."""

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array

WHOLE_UNIT = "unit"
"""The component of a replacement of all of them."""

ECCENTRICITY = (CARTESIAN_NAMES.index("eccentricity_x"), CARTESIAN_NAMES.index("eccentricity_y"))
"""Columns of the coordinates of one growth in a plane: law, parameters and ageing are common to both."""


def columns_of(component: str) -> list[int]:
    """Return the columns of a component: two of an eccentricity, all eight of `WHOLE_UNIT`."""
    if component == WHOLE_UNIT:
        return list(range(len(CARTESIAN_NAMES)))
    return [i for i, name in enumerate(CARTESIAN_NAMES) if name.startswith(component)]


def level_of(levels: Array, component: str) -> Array:
    """Return the levels (…) of one component, of those of all (…, 8): an eccentricity's magnitude."""
    columns = columns_of(component)
    first, last = levels[..., columns[0]], levels[..., columns[-1]]
    return np.asarray(np.hypot(first, last) if len(columns) > 1 else first)
