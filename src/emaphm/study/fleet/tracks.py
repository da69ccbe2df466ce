"""What a way of predicting says at every check flight of a unit, and when a planner removes it for that.

The planner acts at check flights, by the advice that a prognosis gives (`emaphm.prognosis.advice`): a unit is
removed where the advice does not allow it to fly until the next one. Where that is "inspect by", a planner
may count on an inspection instead, and leave the unit until the next check flight.
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
"""A unit is warned of where its probability of failure within the horizon [h] exceeds the risk."""

LATE = 0.2
"""A median is late where it exceeds the true RUL by more than this share of it."""

COSTS = Costs(failure=10.0, replacement=1.0)
"""A failure in service costs ten planned replacements."""


@dataclass(frozen=True)
class Rule:
    """A unit is removed where the advice, by `costs` or by the risk alone, is one of `actions`."""

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


def track(said: Sequence[tuple[float, Array]], failure: float, interval: float) -> dict[str, Any]:
    """Return what is kept of pairs of hours and sample of the RUL [h], one of each check flight of a unit.

    The track, a row of `TRACK` for each; the hours of removal by each rule, None where the unit fails in
    service; the prognostic horizon [h], first met and lasting; the cumulative relative accuracy; the share of
    late predictions. A RUL beyond what is looked at counts as `LONGEST_H`.

    Parameters
    ----------
    failure
        The unit's true end [h].
    interval
        Hours from one check flight to the next [h].
    """
    predictions = [Prediction(hours, np.minimum(sample, LONGEST_H)) for hours, sample in said]
    horizon = prognostic_horizon(predictions, failure)
    return {
        "track": [
            [one.hours, *(one.quantile(p) for p in (0.05, 0.5, 0.95)), one.share_within(0.0, HORIZON_H)]
            for one in predictions
        ],
        "removed": {name: _removed(predictions, interval, rule) for name, rule in RULES.items()},
        "horizon": [horizon.first, horizon.lasting],
        "accuracy": cumulative_relative_accuracy(predictions, failure),
        "late": late_prediction_rate([(one, failure - one.hours) for one in predictions], LATE),
    }


def _removed(predictions: Sequence[Prediction], interval: float, rule: Rule) -> float | None:
    """Return the hours of the first check flight from which the rule does not allow to fly to the next."""
    for one in predictions:
        # A way that gives one number is certain of it: no sample of one, of which the costs would be unknown.
        sample = np.repeat(one.sample, PATHS) if one.sample.size == 1 else one.sample
        advised = advice(sample, interval, risk=RISK, age=one.hours, costs=rule.costs)
        if advised.action in rule.actions:
            return one.hours
    return None


def column(of_way: dict[str, Any], name: str) -> Array:
    """Return a column of `TRACK` of what `track` returned, (flights,)."""
    return np.array(of_way["track"])[:, TRACK.index(name)]
