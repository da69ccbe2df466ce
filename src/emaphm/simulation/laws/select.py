"""Selection and limits without branches, for laws that serve NumPy arrays as well as scalars of a kernel.

A law uses only arithmetic and NumPy functions that are single instructions (`engine.step_tracing`).
Choices are made by `select`: a branch would prevent LLVM from advancing several actuators per instruction.
"""

from typing import Any

import numpy as np


def select(condition: Any, chosen: Any, other: Any) -> Any:
    """Return `chosen` where `condition` holds, else `other`; scalars or arrays."""
    return np.where(condition, chosen, other)


def clip(value: Any, low: Any, high: Any) -> Any:
    """Return `value` limited to [low, high], low ≤ high."""
    return np.minimum(np.maximum(value, low), high)
