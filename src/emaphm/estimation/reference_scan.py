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

CURRENT_LAGS_S = (2e-6, 4e-6, 8e-6, 1.6e-5, 3.2e-5, 6.4e-5)
"""Lags of current sensors that are tried [s]: from next to none to the slowest that drives are built with."""


@dataclass(frozen=True, eq=False)
class ScanResult(Generic[T]):
    """The best value of the parameter, its estimate, and how sharp the minimum is.

    `variance` is that of the logarithm of `value` times the number of independent residuals: infinite where
    the least value tried, or the largest, is the best.
    """

    value: float
    estimate: T
    variance: float


def scan(
    values: Sequence[float], evaluate: Callable[[float], T], cost: Callable[[T], float]
) -> ScanResult[T]:
    """Return the best of increasing `values` > 0, refined by a parabola over the logarithm.

    `evaluate` makes the estimate at a value, `cost` is its mean squared residual.
    """
    estimates = [evaluate(value) for value in values]
    costs = [cost(one) for one in estimates]
    best = int(np.argmin(costs))
    if best in (0, len(values) - 1):
        return ScanResult(values[best], estimates[best], math.inf)
    x = np.log(values[best - 1 : best + 2])
    curvature, slope, _ = np.polyfit(x - x[1], costs[best - 1 : best + 2], 2)
    vertex = float(np.exp(x[1] - slope / (2 * curvature)))
    refined = evaluate(vertex)
    value, estimate = (vertex, refined) if cost(refined) < costs[best] else (values[best], estimates[best])
    return ScanResult(value, estimate, min(cost(refined), costs[best]) / curvature)
