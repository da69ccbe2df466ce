"""Remaining useful lives corrected by how predictions of past units have turned out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis.settings import FORECAST

WIDTH = 0.15
"""Standard deviation of the kernel in the predicted share of life [-]: early, middle and late life differ."""

WEIGHT_OF_NO_CHANGE = 5.0
"""Units without any error that no correction counts as: with five past units, half of it is made."""

LARGEST_ERROR = 4.0
"""Of an error in standard deviations: one life that nothing foresaw must not decide for all."""

LEAST_SPREAD = 0.03
"""Standard deviation of the logarithm of a RUL, at the least."""

SHORTEST = 10.0
"""RUL [h] that the quantiles have at least, of which a prediction's median and spread are taken."""

NORMAL_90 = 1.645
"""Of a standard normal number, 90 % are below it in size."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """Predictions of one past unit that turned out, n of them.

    Attributes
    ----------
    share
        Predicted share of life that was over: age / (age + median RUL), (n,) [-].
    error
        ln(true RUL / median) in standard deviations of the prediction's ln(RUL), (n,) [-].
    """

    unit: str
    share: Array
    error: Array


@dataclass(frozen=True, eq=False)
class Recalibration:
    """What predictions of past units say of a new one, at the same predicted share of life.

    A RUL t of median m and spread s, in logarithms, becomes

        ln t⁺ = ln m + s b + κ (ln t - ln m),

    b being the median of the past errors there, κ the size that 90 % of the errors about b do not exceed, as
    a share of what it is for the normal distribution. Both are shrunk towards none, b = 0 and κ = 1, by
    n / (n + 5), n being the effective number of units [1].

    References
    ----------
    [1] Gneiting, Raftery, Westveld, Goldman: Calibrated probabilistic forecasting using ensemble model output
        statistics and minimum CRPS estimation, Monthly Weather Review 133 (2005): forecasts corrected in
        location and spread by their own record.
    """

    outcomes: Sequence[Outcome]

    def without(self, unit: str) -> "Recalibration":
        """Return it without what became of `unit`."""
        return Recalibration([one for one in self.outcomes if one.unit != unit])

    def correction(self, share: float) -> tuple[float, float]:
        """Return b and κ [-] at a predicted `share` of life."""
        if not self.outcomes:
            return 0.0, 1.0
        near = [np.exp(-0.5 * ((one.share - share) / WIDTH) ** 2) for one in self.outcomes]
        of_units = np.array([one.sum() for one in near])
        if not of_units.sum() > 0:
            return 0.0, 1.0
        number = of_units.sum() ** 2 / np.sum(of_units**2)
        learnt = number / (number + WEIGHT_OF_NO_CHANGE)
        error = np.concatenate([one.error for one in self.outcomes])
        error = np.clip(error, -LARGEST_ERROR, LARGEST_ERROR)
        weights = np.concatenate(near)
        shift = learnt * _quantile(error, weights, 0.5)
        size = max(_quantile(np.abs(error - shift), weights, 0.9) / NORMAL_90, LEAST_SPREAD)
        return shift, float(size**learnt)

    def corrected(self, hours: Array, first: Array, age: float) -> Array:
        """Return times from now on `hours` (…) [h], as the RUL is corrected; 0 and `inf` stay.

        Parameters
        ----------
        first
            The RUL as predicted, a sample of it (n,) [h].
        age
            Of the unit [h].
        """
        middle, spread = log_rul(first)
        if not np.isfinite(middle):
            return hours
        shift, factor = self.correction(age / (age + np.exp(middle)))
        inside = np.isfinite(hours) & (hours > 0)
        logarithm = np.log(np.where(inside, hours, 1.0))
        changed = np.exp(middle + spread * shift + factor * (logarithm - middle))
        return np.asarray(np.where(inside, changed, hours))


def log_rul(sample: Array) -> tuple[float, float]:
    """Return median and standard deviation of ln(RUL), of a `sample` (n,) [h].

    The median is no number where half of the sample or more has failed, or has no failure in sight.
    """
    if not 0 < float(np.median(sample)) < FORECAST.longest_hours:
        return math.nan, 1.0
    low, middle, high = np.quantile(np.clip(sample, SHORTEST, FORECAST.longest_hours), (0.16, 0.5, 0.84))
    return float(np.log(middle)), max(float(np.log(high / low)) / 2, LEAST_SPREAD)


def _quantile(values: Array, weights: Array, share: float) -> float:
    order = np.argsort(values)
    below = np.cumsum(weights[order]) - weights[order] / 2
    return float(np.interp(share * weights.sum(), below, values[order]))
