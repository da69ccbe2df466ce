"""How a law of physics is written once: for NumPy arrays in Python, and for scalars inside a kernel.

A law uses only arithmetic and the NumPy functions that Numba turns into single instructions. Choices
are made by `select`, because a branch would keep LLVM from advancing several actuators per instruction.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

F = TypeVar("F", bound=Callable[..., Any])

LAWS: list[Callable[..., Any]] = []
"""Every law that was imported. Numba learns of them when a kernel is compiled: its import takes 0.1 s."""


def law(function: F) -> F:
    """Let kernels inline `function`; called from Python it stays what it is."""
    LAWS.append(function)
    return function


def select(condition: Any, chosen: Any, other: Any) -> Any:
    """Return `chosen` where `condition` holds, else `other`; scalars or arrays."""
    return np.where(condition, chosen, other)


@law
def clip(value: Any, low: Any, high: Any) -> Any:
    """Return `value` limited to [low, high], low ≤ high."""
    return np.minimum(np.maximum(value, low), high)
