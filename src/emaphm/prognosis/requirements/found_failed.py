"""What ended the life of a unit that has failed, as far as a shop has found it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from emaphm.prognosis.requirements.failure_times import FailureTimes
from emaphm.prognosis.requirements.margins import Limit


def found_failed(
    times: FailureTimes, components: Sequence[str]
) -> tuple[FailureTimes, str | None, Limit | None]:
    """Return failure times with the requirement that failed at 0, and the component and requirement.

    Of a component with several limits, it is the one that was to fail first by the forecast `times`; None
    where no limit is on a component found failed, and both None where no `components` were found.
    """
    places = [i for i, failing in enumerate(times.limits) if failing.component in components]
    if not places:
        return times, components[0] if components else None, None
    place = min(places, key=lambda i: float(np.median(times.hours[i])))
    limit, hours = times.limits[place], times.hours.copy()
    hours[place] = 0.0
    return replace(times, hours=hours), limit.component, limit
