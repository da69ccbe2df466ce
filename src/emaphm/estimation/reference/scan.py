"""Search for a parameter that acts only in the reference model, for example a lag within its switching.

The averaged model has no derivative by such a parameter. The complete estimate is therefore repeated at
several values of the parameter, and the reference model's residual decides.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from emaphm.threads import in_threads

T = TypeVar("T")

CURRENT_LAGS_S = tuple(2e-6 * 2 ** (i / 2) for i in range(11))
"""Lags of current sensors that are evaluated [s]: 2 to 64 µs, the largest lag in drives."""

EQUAL_COSTS = 1.2
"""Costs within this factor count as equal: switching alone changes a mean squared residual by about 10 %."""


@dataclass(frozen=True, eq=False)
class ScanResult(Generic[T]):
    """The best `value` of the parameter, the `estimate` at it, and the standard error of its logarithm.

    The standard error `deviation` is infinite if the least or the largest value fits as well as the best.
    `neighbours` are the estimates at the adjacent values: the true value is between them.
    """

    value: float
    estimate: T
    deviation: float
    neighbours: tuple[T, ...] = ()


NARROWER = 1 / 3
"""Steps of the second parabola, relative to the steps of the given values."""


def scan(
    values: Sequence[float],
    evaluate: Callable[[float], T],
    cost: Callable[[T], float],
    workers: int | None = 1,
) -> ScanResult[T]:
    """Return the best value among increasing `values` > 0 or between them.

    `evaluate` computes the estimate at a value, several in parallel by `workers` threads; `cost` is the mean
    squared residual of an estimate. The true value may be anywhere between the neighbours of the values with
    equal costs; the standard error is that of a uniform distribution there. The best value is the minimum of
    a parabola through three logarithms, which is computed twice, the second time with narrower steps.
    """
    known = dict(zip(values, in_threads(evaluate, values, workers), strict=True))

    def at(value: float) -> float:
        if value not in known:
            known[value] = evaluate(value)
        return cost(known[value])

    costs = np.array([at(value) for value in values])
    best = int(np.argmin(costs))
    equal = np.flatnonzero(costs <= EQUAL_COSTS * costs[best])
    neighbours = tuple(known[values[i]] for i in (best - 1, best + 1) if 0 <= i < len(values))
    if equal[0] == 0 or equal[-1] == len(values) - 1:
        return ScanResult(values[best], known[values[best]], math.inf, neighbours)
    deviation = math.log(values[equal[-1] + 1] / values[equal[0] - 1]) / 12**0.5
    value = _parabola_minimum(values[best - 1 : best + 2], at)
    reach = NARROWER * math.log(values[best + 1] / values[best - 1]) / 2
    value = _parabola_minimum((value * math.exp(-reach), value, value * math.exp(reach)), at)
    return ScanResult(value, known[value], deviation, neighbours)


def _parabola_minimum(values: Sequence[float], cost: Callable[[float], float]) -> float:
    """Return the minimum of a parabola through the logarithms of three values and their costs.

    The best of the three values is returned if the parabola has no minimum between them, or if the cost there
    is clearly larger.
    """
    places, levels = np.log(values), np.log([cost(value) for value in values])
    best = values[int(np.argmin(levels))]
    slopes = np.diff(levels) / np.diff(places)
    curvature = 2 * (slopes[1] - slopes[0]) / (places[2] - places[0])
    if curvature <= 0:
        return best
    lowest = math.exp((places[0] + places[1]) / 2 - slopes[0] / curvature)
    inside = values[0] < lowest < values[2]
    return lowest if inside and cost(lowest) <= EQUAL_COSTS * cost(best) else best
