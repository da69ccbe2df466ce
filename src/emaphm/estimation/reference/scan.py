"""Search for a parameter that acts on the reference model alone, such as a lag inside its switching.

The averaged model has no derivative to follow. The whole estimate is therefore repeated at several values of
the parameter, and the reference model's residual decides.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

T = TypeVar("T")

CURRENT_LAGS_S = tuple(2e-6 * 2 ** (i / 2) for i in range(11))
"""Lags of current sensors that are tried [s]: 2 to 64 µs, the slowest that drives are built with."""

EQUAL_COSTS = 1.2
"""Costs within this factor count as equal: switching alone changes a mean squared residual by about 10 %."""


@dataclass(frozen=True, eq=False)
class ScanResult(Generic[T]):
    """The best value of the parameter, its estimate, and the standard error of the value's logarithm.

    Infinite where the least or the largest value that was tried fits as well as the best. `neighbours` are
    the estimates at the values next to the best: the true value is between them.
    """

    value: float
    estimate: T
    deviation: float
    neighbours: tuple[T, ...] = ()


def scan(
    values: Sequence[float], evaluate: Callable[[float], T], cost: Callable[[T], float]
) -> ScanResult[T]:
    """Return the best of increasing `values` > 0.

    `evaluate` makes the estimate at a value, `cost` is its mean squared residual. The value may lie anywhere
    between the neighbours of those whose costs equal the least; the standard error is that of an even
    distribution there.
    """
    estimates = [evaluate(value) for value in values]
    costs = np.array([cost(one) for one in estimates])
    best = int(np.argmin(costs))
    equal = np.flatnonzero(costs <= EQUAL_COSTS * costs[best])
    neighbours = tuple(estimates[i] for i in (best - 1, best + 1) if 0 <= i < len(values))
    if equal[0] == 0 or equal[-1] == len(values) - 1:
        return ScanResult(values[best], estimates[best], math.inf, neighbours)
    width = math.log(values[equal[-1] + 1] / values[equal[0] - 1])
    return ScanResult(values[best], estimates[best], width / 12**0.5, neighbours)
