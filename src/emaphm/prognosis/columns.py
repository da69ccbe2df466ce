"""Columns of a component in levels of the coordinates `CARTESIAN_NAMES`."""

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array

WHOLE_UNIT = "unit"
"""Name that a replacement of all components has as its component."""

ECCENTRICITY = (CARTESIAN_NAMES.index("eccentricity_x"), CARTESIAN_NAMES.index("eccentricity_y"))
"""Columns of the eccentricity vector; both coordinates share law, parameters and ageing."""


def columns_of(component: str) -> list[int]:
    """Return the columns of a component: two for the eccentricity, all eight for `WHOLE_UNIT`."""
    if component == WHOLE_UNIT:
        return list(range(len(CARTESIAN_NAMES)))
    return [i for i, name in enumerate(CARTESIAN_NAMES) if name.startswith(component)]


def level_of(levels: Array, component: str) -> Array:
    """Return the levels (…) of one component from `levels` (…, 8); for the eccentricity, its magnitude."""
    columns = columns_of(component)
    first, last = levels[..., columns[0]], levels[..., columns[-1]]
    return np.asarray(np.hypot(first, last) if len(columns) > 1 else first)
