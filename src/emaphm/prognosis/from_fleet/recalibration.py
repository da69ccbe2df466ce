"""Remaining useful lives corrected by how predictions of past units have turned out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import PrognosisError
from emaphm.prognosis.settings import FORECAST

WIDTH = 0.15
"""Standard deviation of the kernel in the predicted share of life [-]: early, middle and late life differ."""

SPREADS = 0.5
"""Of the kernel in the logarithm of a forecast's spread: what is said with certainty errs otherwise."""

OF_ANOTHER = 0.1
"""Weight of a forecast of which another requirement fails first: each component degrades by its own laws."""

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


class ForecastSituation(NamedTuple):
    """What a forecast of the RUL looks like, by which it is compared with others; n of them, or one.

    Attributes
    ----------
    share
        Predicted share of life that is over: age / (age + median RUL), (n,) [-].
    spread
        Standard deviation of ln(RUL), (n,) [-].
    first
        Share of the paths that fail each of m limits first, (n, m) [-].
    """

    share: Array
    spread: Array
    first: Array

    @classmethod
    def of(cls, each: Sequence["ForecastSituation"]) -> "ForecastSituation":
        """Return several, one or more, each of one forecast, as one of n."""
        return cls(*(np.stack(column) for column in zip(*each, strict=True)))


@dataclass(frozen=True, eq=False)
class PastForecasts:
    """Forecasts for one past unit whose failure is known, n of them.

    Attributes
    ----------
    situations
        How they looked.
    error
        ln(true RUL / median) in standard deviations of the prediction's ln(RUL), (n,) [-].
    """

    unit: str
    situations: ForecastSituation
    error: Array


@dataclass(frozen=True, eq=False)
class Recalibration:
    """What predictions of past units say of a new one, those that looked alike.

    A RUL t of median m and spread s, in logarithms, becomes

        ln t⁺ = ln m + s b + κ (ln t - ln m),

    b being the median of the past errors, κ the size that 90 % of the errors about b do not exceed, as
    a share of what it is for the normal distribution. Both are shrunk towards none, b = 0 and κ = 1, by
    f n / (n + 5), n being the effective number of units [1] and f `failed_share`, the share of the fleet's
    units that have failed: their lives are the short ones, as long as others still work. A past prediction
    weighs

        exp(-½ (Δshare / 0.15)²) exp(-½ (Δln s / 0.5)²) (0.1 + 0.9 Σ min(p_i, q_i)),

    p and q being the shares of the paths of the two that fail each limit first.

    References
    ----------
    [1] Gneiting, Raftery, Westveld, Goldman: Calibrated probabilistic forecasting using ensemble model output
        statistics and minimum CRPS estimation, Monthly Weather Review 133 (2005): forecasts corrected in
        location and spread by their own record.
    """

    outcomes: Sequence[PastForecasts]
    failed_share: float = 1.0

    def without(self, unit: str) -> "Recalibration":
        """Return the recalibration without the past forecasts of `unit`."""
        return replace(self, outcomes=[one for one in self.outcomes if one.unit != unit])

    def correction(self, situation: ForecastSituation) -> tuple[float, float]:
        """Return b and κ [-] of a prediction that looks like `situation`, one."""
        if not self.outcomes:
            return 0.0, 1.0
        alike = [_likeness(one.situations, situation) for one in self.outcomes]
        of_units = np.array([one.sum() for one in alike])
        if not of_units.sum() > 0:
            return 0.0, 1.0
        number = of_units.sum() ** 2 / np.sum(of_units**2)
        learnt = self.failed_share * number / (number + WEIGHT_OF_NO_CHANGE)
        error = np.concatenate([one.error for one in self.outcomes])
        error = np.clip(error, -LARGEST_ERROR, LARGEST_ERROR)
        weights = np.concatenate(alike)
        shift = learnt * _quantile(error, weights, 0.5)
        size = max(_quantile(np.abs(error - shift), weights, 0.9) / NORMAL_90, LEAST_SPREAD)
        return shift, float(size**learnt)

    def corrected(self, hours: Array, age: float) -> Array:
        """Return when paths fail each limit, `hours` (m, n) from now on [h], as the RUL is corrected.

        0 and `inf` stay. `age` is that of the unit [h].

        Raises
        ------
        PrognosisError
            The limits are not as many as those of the past predictions.
        """
        if any(one.situations.first.shape[1] != len(hours) for one in self.outcomes):
            raise PrognosisError(
                "the fleet's past predictions are of other requirements; make its prior with the actuator of "
                "the prognosis"
            )
        middle, spread = log_rul(hours.min(axis=0))
        if not np.isfinite(middle):
            return hours
        shift, factor = self.correction(situation_of(hours, age))
        inside = np.isfinite(hours) & (hours > 0)
        logarithm = np.log(np.where(inside, hours, 1.0))
        changed = np.exp(middle + spread * shift + factor * (logarithm - middle))
        return np.asarray(np.where(inside, changed, hours))


def situation_of(hours: Array, age: float) -> ForecastSituation:
    """Return what a forecast looks like whose n paths fail m limits in `hours` (m, n) [h], at that age [h].

    Its median must be a number (`log_rul`).
    """
    first = hours.min(axis=0)
    middle, spread = log_rul(first)
    which = hours.argmin(axis=0)[np.isfinite(first)]
    shares = np.bincount(which, minlength=len(hours)) / first.size
    return ForecastSituation(np.asarray(age / (age + np.exp(middle))), np.asarray(spread), shares)


def _likeness(past: ForecastSituation, new: ForecastSituation) -> Array:
    """Return the weights (n,) of `past` predictions for a `new` one."""
    squared_distance = ((past.share - new.share) / WIDTH) ** 2 + (
        np.log(past.spread / new.spread) / SPREADS
    ) ** 2
    same = np.minimum(past.first, new.first).sum(axis=-1)
    return np.asarray(np.exp(-0.5 * squared_distance) * (OF_ANOTHER + (1 - OF_ANOTHER) * same))


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
