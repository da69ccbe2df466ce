"""The types of arrays, and the runs of a flag."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
"""Double precision, any shape; a docstring gives the shape and the unit."""

Flags: TypeAlias = NDArray[np.bool_]
"""True or False, any shape; a docstring gives the shape."""


def runs(true: Flags) -> list[tuple[int, int]]:
    """Return first row and row after the last of each run of True in an array (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], true, [False])).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
