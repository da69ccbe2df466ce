"""Currents that are near their limit most of the time, for example with shorts in all phases.

The averaged model then deviates strongly, and its discrepancy changes from point to point, so that a bias
correction ends in one of many local minima along a curved valley. The residual at such an end point clearly
exceeds noise and switching but is small relative to the current: `SMALLEST_SHARE` would accept it.
"""

import numpy as np

from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult

HEAVY = 0.45
"""Least rms of a heavy current, relative to its limit: of 40 random fault vectors with shorts up to 0.7, the
largest rms was 0.38; wrong local minima began at 0.46."""

SWITCHING_ALONE = 1.1
"""Largest residual of a channel, relative to noise and switching, that they account for: 0.93 to 1.13 at the
true parameters."""


def is_heavy(problem: Problem) -> bool:
    """Return whether the primary channel is a current that is near its limit most of the time."""
    limit = problem.actuator.controller.current_limit
    return problem.primary == "current_A" and bool(np.mean(problem.recorded**2) > (HEAVY * limit) ** 2)


def leaves_switching_alone(result: SearchResult) -> bool:
    """Return whether noise and switching account for the residual, without `SMALLEST_SHARE` of the signal."""
    return result.residual_over_switching <= SWITCHING_ALONE
