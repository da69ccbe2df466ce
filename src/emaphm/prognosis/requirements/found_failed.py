"""Failed component and requirement of a failed unit, from the findings of a shop."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from emaphm.prognosis.requirements.failure_times import FailureTimes
from emaphm.prognosis.requirements.margins import Limit


def found_failed(
    times: FailureTimes, components: Sequence[str]
) -> tuple[FailureTimes, str | None, Limit | None]:
    """Return failure times in which the failed requirement has 0 h, the failed component and its limit.

    If the component has several limits, it is the limit with the smallest median failure time in the forecast
    `times`. The limit is None if no limit is on a failed component; both are None without `components`.
    """
    indices = [i for i, candidate in enumerate(times.limits) if candidate.component in components]
    if not indices:
        return times, components[0] if components else None, None
    index = min(indices, key=lambda i: float(np.median(times.hours[i])))
    limit, hours = times.limits[index], times.hours.copy()
    hours[index] = 0.0
    return replace(times, hours=hours), limit.component, limit
