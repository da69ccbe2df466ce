"""Recalibration of remaining useful lives by the errors of predictions of past units."""

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
"""Standard deviation of the kernel in the logarithm of a forecast's spread: narrow forecasts have other
errors."""

OF_ANOTHER = 0.1
"""Weight of a forecast in which another requirement fails first: components degrade by different laws."""

WEIGHT_OF_NO_CHANGE = 5.0
"""Number of past units without error that are added: with five past units, half of the correction is
applied."""

LARGEST_ERROR = 4.0
"""Largest error in standard deviations: a single unforeseeable life must not determine the correction."""

LEAST_SPREAD = 0.03
"""Smallest standard deviation of the logarithm of a RUL."""

SHORTEST = 10.0
"""Lower limit of the RUL [h] in the quantiles that give a prediction's median and spread."""

NORMAL_90 = 1.645
"""Magnitude below which 90 % of standard normal numbers are."""


class ForecastSituation(NamedTuple):
    """Features of one or n forecasts of the RUL, for the comparison of forecasts.

    Attributes
    ----------
    share
        Predicted consumed share of life: age / (age + median RUL), (n,) [-].
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
        """Return the features of n ≥ 1 forecasts, given those of each."""
        return cls(*(np.stack(column) for column in zip(*each, strict=True)))


@dataclass(frozen=True, eq=False)
class PastForecasts:
    """n forecasts for a past unit whose failure is known.

    Attributes
    ----------
    situations
        Features of the forecasts.
    error
        ln(true RUL / median) in standard deviations of the prediction's ln(RUL), (n,) [-].
    """

    unit: str
    situations: ForecastSituation
    error: Array


@dataclass(frozen=True, eq=False)
class Recalibration:
    """Correction of a forecast by the errors of past forecasts with similar features.

    A RUL t of a sample with median m, and spread s of ln t, becomes

        ln t⁺ = ln m + s b + κ (ln t - ln m),

    where b is the median of the past errors, and κ the 90 % quantile of the errors about b in magnitude,
    relative to that of the normal distribution. Both are shrunk towards no correction, b = 0 and κ = 1, by
    f n / (n + 5), where n is the effective number of units [1] and f is `failed_share`, the share of the
    fleet's units that have failed: while other units still work, the failed units are the short-lived ones. A
    past prediction has the weight

        exp(-½ (Δshare / 0.15)²) exp(-½ (Δln s / 0.5)²) (0.1 + 0.9 Σ min(p_i, q_i)),

    where p and q are the shares of the paths of the two forecasts that fail each limit first.

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
        return replace(self, outcomes=[past for past in self.outcomes if past.unit != unit])

    def correction(self, situation: ForecastSituation) -> tuple[float, float]:
        """Return b and κ [-] for a prediction with the features `situation`."""
        if not self.outcomes:
            return 0.0, 1.0
        weights_by_unit = [_similarity_weights(past.situations, situation) for past in self.outcomes]
        of_units = np.array([weights.sum() for weights in weights_by_unit])
        if not of_units.sum() > 0:
            return 0.0, 1.0
        number = of_units.sum() ** 2 / np.sum(of_units**2)
        learnt = self.failed_share * number / (number + WEIGHT_OF_NO_CHANGE)
        error = np.concatenate([past.error for past in self.outcomes])
        error = np.clip(error, -LARGEST_ERROR, LARGEST_ERROR)
        weights = np.concatenate(weights_by_unit)
        shift = learnt * _quantile(error, weights, 0.5)
        spread_factor = max(_quantile(np.abs(error - shift), weights, 0.9) / NORMAL_90, LEAST_SPREAD)
        return shift, float(spread_factor**learnt)

    def corrected(self, hours: Array, age: float) -> Array:
        """Return the corrected failure times of the paths, given `hours` (m, n) from now on [h].

        0 and `inf` are not changed. `age` is that of the unit [h].

        Raises
        ------
        PrognosisError
            The number of limits differs from that of the past predictions.
        """
        if any(past.situations.first.shape[1] != len(hours) for past in self.outcomes):
            raise PrognosisError(
                "the fleet's past predictions have other requirements; compute its prior with the actuator "
                "of the prognosis"
            )
        median, spread = log_rul(hours.min(axis=0))
        if not np.isfinite(median):
            return hours
        shift, factor = self.correction(situation_of(hours, age))
        is_finite = np.isfinite(hours) & (hours > 0)
        logarithm = np.log(np.where(is_finite, hours, 1.0))
        changed = np.exp(median + spread * shift + factor * (logarithm - median))
        return np.asarray(np.where(is_finite, changed, hours))


def situation_of(hours: Array, age: float) -> ForecastSituation:
    """Return the features of a forecast with failure times `hours` (m, n) [h] at `age` [h].

    Its median must be finite (`log_rul`).
    """
    first = hours.min(axis=0)
    median, spread = log_rul(first)
    first_limit = hours.argmin(axis=0)[np.isfinite(first)]
    shares = np.bincount(first_limit, minlength=len(hours)) / first.size
    return ForecastSituation(np.asarray(age / (age + np.exp(median))), np.asarray(spread), shares)


def _similarity_weights(past: ForecastSituation, new: ForecastSituation) -> Array:
    """Return the weights (n,) of `past` predictions for a `new` prediction."""
    squared_distance = ((past.share - new.share) / WIDTH) ** 2 + (
        np.log(past.spread / new.spread) / SPREADS
    ) ** 2
    overlap = np.minimum(past.first, new.first).sum(axis=-1)
    return np.asarray(np.exp(-0.5 * squared_distance) * (OF_ANOTHER + (1 - OF_ANOTHER) * overlap))


def log_rul(sample: Array) -> tuple[float, float]:
    """Return the median and the standard deviation of ln(RUL) of a `sample` (n,) [h].

    The median is NaN if half of the sample or more has failed, or has no failure in sight.
    """
    if not 0 < float(np.median(sample)) < FORECAST.longest_hours:
        return math.nan, 1.0
    low, median, high = np.quantile(np.clip(sample, SHORTEST, FORECAST.longest_hours), (0.16, 0.5, 0.84))
    return float(np.log(median)), max(float(np.log(high / low)) / 2, LEAST_SPREAD)


def _quantile(values: Array, weights: Array, share: float) -> float:
    """Return the quantile `share` of weighted values (n,)."""
    order = np.argsort(values)
    below = np.cumsum(weights[order]) - weights[order] / 2
    return float(np.interp(share * weights.sum(), below, values[order]))
