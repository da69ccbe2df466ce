"""Search for a parameter that acts on the reference model alone, such as a lag inside its switching.

The averaged model has no derivative to follow. The whole estimate is therefore repeated at several values of
the parameter, and the reference model's residual decides.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from emaphm.threads import in_threads

T = TypeVar("T")

CURRENT_LAGS_S = tuple(2e-6 * 2 ** (i / 2) for i in range(11))
"""Lags of current sensors that are tried [s]: 2 to 64 µs, the slowest that drives are built with."""

EQUAL_COSTS = 1.2
"""Costs within this factor count as equal: switching alone changes a mean squared residual by about 10 %."""


@dataclass(frozen=True, eq=False)
class ScanResult(Generic[T]):
    """The best value of the parameter, its estimate, and the standard error of the value's logarithm.

    Infinite where the least or the largest value that was tried fits as well as the best. `neighbours` are
    the estimates at the values next to it: the true value is between them.
    """

    value: float
    estimate: T
    deviation: float
    neighbours: tuple[T, ...] = ()


NARROWER = 1 / 3
"""Steps of the second parabola, relative to those of the values that are tried first."""


def scan(
    values: Sequence[float],
    evaluate: Callable[[float], T],
    cost: Callable[[T], float],
    workers: int | None = 1,
) -> ScanResult[T]:
    """Return the best of increasing `values` > 0, or of what lies between them.

    `evaluate` makes the estimate at a value, for several at once by `workers` threads; `cost` is its mean
    squared residual. The value may lie anywhere between the neighbours of those whose costs equal the least;
    the standard error is that of an even distribution there. Within it, the least cost is where a parabola
    through three logarithms has it; it is looked for twice, the second time with narrower steps.
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
    value = _lowest(values[best - 1 : best + 2], at)
    reach = NARROWER * math.log(values[best + 1] / values[best - 1]) / 2
    value = _lowest((value * math.exp(-reach), value, value * math.exp(reach)), at)
    return ScanResult(value, known[value], deviation, neighbours)


def _lowest(values: Sequence[float], cost: Callable[[float], float]) -> float:
    """Return where a parabola through the logarithms of three values and costs is lowest.

    Or the best of the three, where it has no minimum between them, or the cost there is clearly larger.
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
