"""Consequences of acting on predictions: late predictions, wasted life, false alarms."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from emaphm.errors import PrognosisError
from emaphm.prognosis.metrics.prediction import Prediction


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
