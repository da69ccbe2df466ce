"""Predictions of a method at all check flights of a unit, and the hours of removal that follow from them.

The planner decides at check flights by the advice of a prognosis (`emaphm.prognosis.advice`): a unit is
removed if the advice does not allow it to fly until the next check flight. If the advice is "inspect by", a
planner may rely on an inspection instead, and let the unit fly until the next check flight.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis.advice import Costs, advice
from emaphm.prognosis.metrics import (
    Prediction,
    cumulative_relative_accuracy,
    late_prediction_rate,
    prognostic_horizon,
)
from emaphm.study.fleet.baselines import LONGEST_H, PATHS

HORIZON_H, RISK = 400.0, 0.05
"""A warning is given if the probability of failure within the horizon [h] exceeds the risk."""

LATE = 0.2
"""A median is late if it exceeds the true RUL by more than this share of the RUL."""

COSTS = Costs(failure=10.0, replacement=1.0)
"""A failure in service costs ten planned replacements."""


@dataclass(frozen=True)
class Rule:
    """Rule of removal: the advice, from `costs` or from the risk alone, is one of `actions`."""

    costs: Costs | None
    actions: tuple[str, ...]


BY_RISK, BY_RISK_OR_INSPECTED, BY_COSTS = "the risk", "the risk, inspections aside", "the costs"

RULES = {
    BY_RISK: Rule(None, ("inspect by", "replace before")),
    BY_RISK_OR_INSPECTED: Rule(None, ("replace before",)),
    BY_COSTS: Rule(COSTS, ("inspect by", "replace before")),
}

TRACK = ("hours", "low", "median", "high", "probability")
"""Columns of a track: flight hours, 5 %, median and 95 % of the RUL [h], P(failure within `HORIZON_H`)."""


def track(samples: Sequence[tuple[float, Array]], failure: float, interval: float) -> dict[str, Any]:
    """Return a summary of the predictions at all check flights of a unit.

    The track, with a row of `TRACK` per check flight; the hours of removal by each rule, None if the unit
    fails in service; the prognostic horizon [h], first met and lasting; the cumulative relative accuracy; the
    share of late predictions. A RUL above `LONGEST_H` counts as `LONGEST_H`.

    Parameters
    ----------
    samples
        Pairs of flight hours and sample of the RUL [h], one per check flight.
    failure
        True hours of the unit's failure [h].
    interval
        Hours between two check flights [h].
    """
    predictions = [Prediction(hours, np.minimum(sample, LONGEST_H)) for hours, sample in samples]
    horizon = prognostic_horizon(predictions, failure)
    return {
        "track": [
            [
                prediction.hours,
                *(prediction.quantile(p) for p in (0.05, 0.5, 0.95)),
                prediction.share_within(0.0, HORIZON_H),
            ]
            for prediction in predictions
        ],
        "removed": {name: _removed(predictions, interval, rule) for name, rule in RULES.items()},
        "horizon": [horizon.first, horizon.lasting],
        "accuracy": cumulative_relative_accuracy(predictions, failure),
        "late": late_prediction_rate(
            [(prediction, failure - prediction.hours) for prediction in predictions], LATE
        ),
    }


def _removed(predictions: Sequence[Prediction], interval: float, rule: Rule) -> float | None:
    """Return the hours of the first check flight at which the rule removes the unit, or None."""
    for prediction in predictions:
        # A single number is a certain prediction: repeated, because costs cannot be estimated from one draw.
        sample = prediction.sample
        sample = np.repeat(sample, PATHS) if sample.size == 1 else sample
        advised = advice(sample, interval, risk=RISK, age=prediction.hours, costs=rule.costs)
        if advised.action in rule.actions:
            return prediction.hours
    return None


def column(summary: dict[str, Any], name: str) -> Array:
    """Return a column of `TRACK` from a result of `track`, (flights,)."""
    return np.array(summary["track"])[:, TRACK.index(name)]
