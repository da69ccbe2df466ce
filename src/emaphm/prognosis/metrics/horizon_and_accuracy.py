"""Prognostic horizon, alpha-lambda and relative accuracy of the predictions of one unit, after Saxena [1].

λ is a time as a share of the interval from the first prediction to the failure:
t_λ = t_1 + λ (failure - t_1).

`progpy` computes relative accuracy from the time of the event instead of the RUL, so that the accuracy of any
prediction increases with the age of the unit, and it does not withdraw a horizon that is lost later. Convert
its values before comparing: see `relative_accuracy` and `PrognosticHorizon`.

References
----------
[1] Saxena, Celaya, Saha, Saha, Goebel: Metrics for offline evaluation of prognostic performance,
    International Journal of Prognostics and Health Management 1 (2010).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.errors import PrognosisError
from emaphm.prognosis.metrics.prediction import Prediction

ROUNDING = 1e-9
"""Rounding tolerance of hours that are computed in different ways, as a share of a life."""


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
