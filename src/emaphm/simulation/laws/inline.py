"""How a law of physics is written once: for NumPy arrays in Python, and for scalars inside a kernel.

A law uses only arithmetic and the NumPy functions that Numba turns into single instructions; choices
are made by `select`, because a branch would keep LLVM from advancing several actuators per instruction.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba.extending import overload, register_jitable

F = TypeVar("F", bound=Callable[..., Any])


def law(function: F) -> F:
    """Let kernels inline `function`; called from Python it stays what it is."""
    inlined: F = register_jitable(function)
    return inlined


def select(condition: Any, chosen: Any, other: Any) -> Any:
    """Return `chosen` where `condition` holds, else `other`; scalars or arrays."""
    return np.where(condition, chosen, other)


@overload(select)
def _select_scalar(condition: Any, chosen: Any, other: Any) -> Any:  # noqa: ARG001
    def implementation(condition: Any, chosen: Any, other: Any) -> Any:
        return chosen if condition else other

    return implementation
