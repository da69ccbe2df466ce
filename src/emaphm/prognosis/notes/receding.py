"""Note on readings on the other side of the healthy value than the limit, which the forecast ignores."""

import math

import numpy as np

from emaphm.prognosis.indicator.readings import FAILING, Indicator

NEWEST = 5
"""Number of newest readings whose mean is tested; older readings do not describe the present state."""

SIGNIFICANT = 4.0
"""Standard errors by which the mean must be beyond the healthy value."""

LEAST_SHARE = 0.1
"""Share of the margin by which the mean must be beyond healthy: less may be an inexact healthy value."""


def receding_notes(indicator: Indicator) -> list[str]:
    """Return a note if the newest readings are on the other side of the healthy value than the limit.

    Their mean level, weighted by 1 / variance, is compared with 0. Its standard error is the larger of that
    from the stated variances and that from the scatter. There is no note with fewer than `NEWEST` readings.
    """
    readings = sorted(indicator.readings, key=lambda reading: reading.hours)[-NEWEST:]
    if len(readings) < NEWEST:
        return []
    scale = FAILING / abs(indicator.fails_at - indicator.healthy)
    levels = np.array([float(indicator.level(reading.value)) for reading in readings])
    weights = np.array([1 / reading.variance for reading in readings])
    mean = float(np.average(levels, weights=weights))
    error = max(scale / math.sqrt(float(weights.sum())), float(levels.std(ddof=1)) / math.sqrt(NEWEST))
    if mean > -max(SIGNIFICANT * error, LEAST_SHARE * FAILING):
        return []
    share = -100 * mean / FAILING
    note = (
        f"the newest {NEWEST} readings are beyond healthy, away from the limit, by {share:.0f} % of the way "
        "to it: the forecast takes them as healthy and does not predict them; check whether the healthy "
        "value and the side of the limit are right"
    )
    return [note]
