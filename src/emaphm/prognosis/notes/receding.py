"""Readings that are beyond healthy, on the other side than the limit: the forecast says nothing of them."""

import math

import numpy as np

from emaphm.prognosis.indicator.readings import FAILING, Indicator

NEWEST = 5
"""Readings whose mean is looked at, the last ones: what was passed long ago says nothing of today."""

SIGNIFICANT = 4.0
"""Standard errors of that mean by which it must be beyond healthy."""

LEAST_SHARE = 0.1
"""By which share of the way from healthy to the limit it must be beyond: less is an inexact healthy value."""


def receding_notes(indicator: Indicator) -> list[str]:
    """Return what it means that the newest readings are on the other side of healthy than the limit.

    Their mean level, weighted by 1 / variance, is compared with 0, with the standard error that the readings
    state or that their scatter about the mean shows, the larger of both. Fewer than `NEWEST` say nothing.
    """
    readings = sorted(indicator.readings, key=lambda one: one.hours)[-NEWEST:]
    if len(readings) < NEWEST:
        return []
    scale = FAILING / abs(indicator.fails_at - indicator.healthy)
    levels = np.array([float(indicator.level(one.value)) for one in readings])
    weights = np.array([1 / one.variance for one in readings])
    mean = float(np.average(levels, weights=weights))
    error = max(scale / math.sqrt(float(weights.sum())), float(levels.std(ddof=1)) / math.sqrt(NEWEST))
    if mean > -max(SIGNIFICANT * error, LEAST_SHARE * FAILING):
        return []
    share = -100 * mean / FAILING
    note = (
        f"the newest {NEWEST} readings are beyond healthy, away from the limit, by {share:.0f} % of the way "
        "to it: the forecast takes them as healthy and says nothing of what moves them; see whether the "
        "healthy value and the side of the limit are right"
    )
    return [note]
