"""Currents that are near their limit most of the time, as shorts in all phases keep them.

The averaged model is far off there, and its discrepancy changes from point to point, so that a bias
correction ends in one of many false minima along a curved valley. What such an end leaves is clearly more
than noise and switching, and still little relative to the current: `SMALLEST_SHARE` lets it pass.
"""

import numpy as np

from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult

HEAVY = 0.45
"""Rms of a heavy current, relative to its limit: of 40 random vectors with shorts up to 0.7, the largest had
0.38, and false minima began at 0.46."""

SWITCHING_ALONE = 1.1
"""Largest residual of a channel relative to noise and switching where these account for it: 0.93 to 1.13 at
the truth."""


def is_heavy(problem: Problem) -> bool:
    """Return whether the primary channel is a current that is near its limit most of the time."""
    limit = problem.actuator.controller.current_limit
    return problem.primary == "current_A" and bool(np.mean(problem.recorded**2) > (HEAVY * limit) ** 2)


def leaves_switching_alone(result: SearchResult) -> bool:
    """Return whether noise and switching account for the residual, with no share of the signal."""
    return result.residual_over_switching <= SWITCHING_ALONE
