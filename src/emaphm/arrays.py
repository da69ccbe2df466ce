"""The type of every array of numbers."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
"""Double precision, any shape; a docstring gives the shape and the unit."""
