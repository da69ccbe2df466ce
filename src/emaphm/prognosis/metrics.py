"""Metrics of predictions of remaining useful life (RUL) against the time at which the unit failed.

All times are flight hours [h]; a prediction is a sample of the RUL, in which `inf` means no failure in sight.
The true RUL at hours t is failure - t. λ is a time as a share of the interval from the first prediction to
the failure: t_λ = t_1 + λ (failure - t_1).

`progpy` computes relative accuracy from the time of the event instead of the RUL, so that the accuracy of any
prediction increases with the age of the unit, and it does not withdraw a horizon that is lost later. Convert
its values before comparing: see `relative_accuracy` and `PrognosticHorizon`.

References
----------
[1] Saxena, Celaya, Saha, Saha, Goebel: Metrics for offline evaluation of prognostic performance,
    International Journal of Prognostics and Health Management 1 (2010).
[2] Gneiting, Raftery: Strictly proper scoring rules, prediction, and estimation, Journal of the American
    Statistical Association 102 (2007).
[3] Brier: Verification of forecasts expressed in terms of probability, Monthly Weather Review 78 (1950).
[4] Dawid: Present position and potential developments: the prequential approach, Journal of the Royal
    Statistical Society A 147 (1984).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from emaphm.arrays import Array
from emaphm.errors import PrognosisError
from emaphm.quantiles import sample_quantile

ROUNDING = 1e-9
"""Rounding tolerance of hours that are computed in different ways, as a share of a life."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """A predicted RUL at flight `hours` [h]: an equally weighted sample [h], shape (n,), n ≥ 1.

    Raises
    ------
    PrognosisError
        The sample is empty, or a value is negative or not a number.
    """

    hours: float
    sample: Array

    def __post_init__(self) -> None:
        sample = np.sort(np.asarray(self.sample, float).ravel())
        if not sample.size or not sample[0] >= 0 or np.isnan(sample[-1]):
            raise PrognosisError(
                f"the prediction at {self.hours:.9g} h needs a sample of RUL values of 0 or more, got "
                f"{sample.size} values"
            )
        object.__setattr__(self, "sample", sample)

    @property
    def median(self) -> float:
        """Median of the RUL [h]; `inf` if no failure is in sight."""
        return self.quantile(0.5)

    def quantile(self, probability: float) -> float:
        """Return the quantile of the RUL [h]: the smallest value not below that share of the sample."""
        return sample_quantile(self.sample, probability)

    def share_within(self, low: float, high: float) -> float:
        """Return the probability that low ≤ RUL ≤ high [h]."""
        last = np.searchsorted(self.sample, high, "right")
        return float(last - np.searchsorted(self.sample, low, "left")) / self.sample.size


@dataclass(frozen=True)
class PrognosticHorizon:
    """Time before the failure at which the predictions became good [h], 0 if they never were.

    first
        Time from the first good prediction to the failure (the definition of [1] as `progpy` computes it).
    lasting
        Time from the first good prediction after which all predictions were good: a horizon that is lost
        later does not count.
    """

    first: float
    lasting: float


def prognostic_horizon(
    predictions: Sequence[Prediction], failure: float, *, alpha: float = 0.2, beta: float = 0.5
) -> PrognosticHorizon:
    """Return the time before `failure` at which predictions became good: P(|RUL - RUL*| ≤ α L) ≥ β.

    L is the full life `failure`, so that the band has the same width at all times [1, 3.1]; in `alpha_lambda`
    it narrows with the RUL. Predictions after the failure are ignored.
    """
    before = [prediction for prediction in predictions if prediction.hours < failure]
    good = [
        prediction.share_within(
            failure - prediction.hours - alpha * failure, failure - prediction.hours + alpha * failure
        )
        >= beta
        for prediction in before
    ]
    hours = [prediction.hours for prediction in before]
    first = next((failure - t for t, is_good in zip(hours, good, strict=True) if is_good), 0.0)
    lasting = 0.0
    for t, is_good in zip(reversed(hours), reversed(good), strict=True):
        if not is_good:
            break
        lasting = failure - t
    return PrognosticHorizon(first, lasting)


def at_share_of_life(hours: Sequence[float], failure: float, share: float) -> int:
    """Return the index of the last prediction at or before t_λ, within rounding.

    `hours` are those of all predictions of a unit [h], increasing; λ is the `share`.

    Raises
    ------
    PrognosisError
        There is no prediction before the failure, or the share is outside [0, 1].
    """
    if not 0 <= share <= 1:
        raise PrognosisError(f"λ = {share:g} is no share of life; give a value from 0 to 1")
    before = [time for time in hours if time < failure]
    if not before:
        raise PrognosisError(f"no prediction before the failure at {failure:.9g} h; predict earlier")
    reached = before[0] + share * (failure - before[0])
    return sum(time <= reached + ROUNDING * failure for time in before) - 1


def alpha_lambda(
    predictions: Sequence[Prediction], failure: float, share: float, *, alpha: float = 0.2, beta: float = 0.5
) -> bool:
    """Return whether the prediction at t_λ is good: P((1 - α) RUL* ≤ RUL ≤ (1 + α) RUL*) ≥ β [1, 3.2].

    Parameters
    ----------
    predictions, failure, share
        Predictions of a unit by increasing hours; time of its failure [h]; λ. Errors as in
        `at_share_of_life`.
    alpha
        α, half-width of the band as a share of the true RUL, RUL*.
    beta
        β, the least probability within the band.
    """
    prediction = predictions[at_share_of_life([item.hours for item in predictions], failure, share)]
    true = failure - prediction.hours
    return prediction.share_within((1 - alpha) * true, (1 + alpha) * true) >= beta


def relative_accuracy(prediction: Prediction, failure: float) -> float:
    """Return the relative accuracy 1 - |median RUL - RUL*| / RUL* [1, 3.3]; -∞ if no failure is in sight.

    `progpy` has 1 - |mean end of life - failure| / failure. With the mean in place of the median, this is
    1 - (RUL* / failure) (1 - a), where a is the value returned here.
    """
    true = failure - prediction.hours
    if not true > 0:
        raise PrognosisError(
            f"relative accuracy at {prediction.hours:.9g} h: the failure at {failure:.9g} h is not later"
        )
    return 1 - abs(prediction.median - true) / true


def cumulative_relative_accuracy(predictions: Sequence[Prediction], failure: float) -> float:
    """Return the mean relative accuracy of all predictions before the failure, equally weighted [1, 3.4]."""
    before = [prediction for prediction in predictions if prediction.hours < failure]
    if not before:
        raise PrognosisError(f"no prediction before the failure at {failure:.9g} h; predict earlier")
    return float(np.mean([relative_accuracy(prediction, failure) for prediction in before]))


def probability_integral_transform(prediction: Prediction, true: float) -> float:
    """Return P(RUL < true) + P(RUL = true) / 2 [4]; uniform on [0, 1] over many calibrated predictions."""
    below = np.searchsorted(prediction.sample, true, "left")
    upto = np.searchsorted(prediction.sample, true, "right")
    return float(below + upto) / (2 * prediction.sample.size)


def coverage(transforms: ArrayLike, share: float = 0.9) -> float:
    """Return the share of the probability integral transforms (n,) in the central interval of `share`."""
    values = np.asarray(transforms, float)
    return float(np.mean(np.abs(values - 0.5) <= share / 2))


def crps(sample: ArrayLike, true: float, *, longest: float = np.inf) -> float:
    """Return the continuous ranked probability score [h] of a sample (n,) against the `true` RUL.

    CRPS = ∫ (F(x) - 1[x ≥ true])² dx = E|X - true| - ½ E|X - X'|            [2, eq. 20, 21]

    Values above `longest` [h], including the true RUL, are set to `longest`: a sample that contains `inf` (no
    failure in sight) has a finite score only up to a finite time.
    """
    x = np.minimum(np.sort(np.asarray(sample, float)), longest)
    n = x.size
    if not np.isfinite(x[-1]):
        return float(np.inf)
    # E|X - X'| of a sorted sample: 2 Σ (2 i - n - 1) x_i / n², i from 1.
    spread = 2 * np.sum((2 * np.arange(1, n + 1) - n - 1) * x) / n**2
    return float(np.mean(np.abs(x - min(true, longest))) - spread / 2)


def brier(probabilities: ArrayLike, happened: ArrayLike) -> float:
    """Return the Brier score of "fails within H": the mean of (probability - 1 or 0)² [3]."""
    p, o = np.asarray(probabilities, float), np.asarray(happened, bool)
    if p.shape != o.shape or not p.size or not np.all((p >= 0) & (p <= 1)):
        raise PrognosisError("the Brier score takes as many probabilities in [0, 1] as outcomes, one or more")
    return float(np.mean((p - o) ** 2))


def late_prediction_rate(predictions: Sequence[tuple[Prediction, float]], margin: float = 0.0) -> float:
    """Return the share of predictions, each with its true RUL [h], whose median exceeds the true RUL.

    A prediction counts if its median exceeds the true RUL by more than `margin`, a share of the true RUL.
    """
    if not predictions:
        raise PrognosisError("no predictions; give one or more")
    return float(np.mean([prediction.median > (1 + margin) * true for prediction, true in predictions]))


def wasted_life(removals: ArrayLike, failures: ArrayLike) -> float:
    """Return the mean unused share of life of units with hours of removal (n,) and of failure (n,).

    The unused share of a unit that failed before its removal is 0.
    """
    at, end = np.asarray(removals, float), np.asarray(failures, float)
    if at.shape != end.shape or not np.all(end > 0):
        raise PrognosisError("wasted life takes a removal for each failure, whose hours are above 0")
    return float(np.mean(np.maximum(1 - at / end, 0.0)))


def false_alarms_per_1000_hours(alarms: Sequence[tuple[float, float]], flown: float, within: float) -> float:
    """Return the number of alarms with a true RUL above `within`, per 1,000 of the `flown` hours.

    `alarms` are pairs of hours [h] and true RUL [h] at that time (`inf` if unknown); `flown` are the hours of
    all units.
    """
    if not flown > 0:
        raise PrognosisError(f"{flown:.9g} flown hours; give those of all units, above 0")
    return 1000 * sum(true > within for _, true in alarms) / flown
