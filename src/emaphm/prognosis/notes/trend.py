"""Straight line through the values of a unit's diagnoses."""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array


@dataclass(frozen=True)
class Trend:
    """Slope [1/h] of a straight line, its standard error, and the median slope from one value to the next."""

    slope: float
    standard_error: float
    median_slope: float

    @classmethod
    def of(cls, hours: Array, values: Array, least_variance: float) -> "Trend":
        """Return the trend of `values` (n,) at ordered flight `hours` (n,) [h], n ≥ 3, not all equal.

        The variance of a value is that of the residuals, at least `least_variance`.
        """
        centred = hours - hours.mean()
        size = float(centred @ centred)
        slope = float(centred @ values) / size
        residual = values - values.mean() - slope * centred
        variance = max(float(residual @ residual) / (values.size - 2), least_variance)
        is_later = np.diff(hours) > 0
        steps = np.diff(values)[is_later] / np.diff(hours)[is_later]
        return cls(slope, float(np.sqrt(variance / size)), float(np.median(steps)))
