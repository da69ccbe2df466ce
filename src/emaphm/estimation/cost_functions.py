"""Fitness: distance of a simulated signal from the recorded signal; the equivalent current in thesis 6.2."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from emaphm.arrays import Array

CostFunction: TypeAlias = Callable[[Array, Array, float], Array]
"""Maps recorded (samples,) and simulated (n, samples) signals, interval [s], to fitness (n,)."""


def least_squares(recorded: Array, simulated: Array, interval: float) -> Array:  # noqa: ARG001
    """Return the mean squared difference [A²] of `recorded` (samples,) and `simulated` (n, samples), (n,)."""
    return np.asarray(np.mean((recorded - simulated) ** 2, axis=-1))


def thesis(recorded: Array, simulated: Array, interval: float) -> Array:
    """Return the thesis's fitness [A² s]: squared differences, each divided by sqrt((dI/dt)² + 1).

    The printed formula is damaged; this is the reading that fits "total least squares": the distance
    of a point from a curve of slope dI/dt. `interval` in s, dI/dt of the recorded current in A/s.
    """
    slope = np.gradient(recorded, interval)
    return np.asarray(np.sum((recorded - simulated) ** 2 / np.sqrt(slope**2 + 1), axis=-1) * interval)


def total_least_squares(recorded: Array, simulated: Array, interval: float) -> Array:
    """Return the sum of squared orthogonal distances [A² s]: the formula of `thesis` without the root."""
    slope = np.gradient(recorded, interval)
    return np.asarray(np.sum((recorded - simulated) ** 2 / (slope**2 + 1), axis=-1) * interval)


COST_FUNCTIONS: dict[str, CostFunction] = {
    "least_squares": least_squares,
    "thesis": thesis,
    "total_least_squares": total_least_squares,
}
