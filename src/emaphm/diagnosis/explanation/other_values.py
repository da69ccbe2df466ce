"""Intervals that include what another explanation of the recording says, which explains it as well."""

from dataclasses import replace

import numpy as np

from emaphm.actuator.faults import HEALTHY
from emaphm.diagnosis.verdict import Estimate, verdict_of

OTHER_DIRECTION = 0.02
"""How far a direction must be off to count as another; by more than the half-width of its interval, too."""


def with_other_value(name: str, estimate: Estimate, first: Estimate, other: float, why: str) -> Estimate:
    """Return an `estimate` whose interval has the value of an alternative too.

    It is undecided where that interval says another thing than `first`, the estimate without alternatives,
    and a direction where it is another one; `why` says under which condition the `other` value explains the
    recording. The alternative is known as well as the first.
    """
    if first.unconstrained:
        return estimate
    low, high = first.interval95
    half_width = (high - low) / 2
    least, most = first.limits
    if name == "eccentricity_phase":
        other = first.value + (other - first.value + 0.5) % 1.0 - 0.5
        least, most = -np.inf, np.inf
    interval = (
        min(estimate.interval95[0], max(other - half_width, least)),
        max(estimate.interval95[1], min(other + half_width, most)),
    )
    estimate = replace(estimate, interval95=interval)
    if name == "eccentricity_phase":  # a direction is neither good nor bad
        another = abs(other - first.value) > max(OTHER_DIRECTION, half_width)
    else:
        another = verdict_of(interval, getattr(HEALTHY, name)) != first.verdict
    if first.verdict == "cannot tell" or not another:
        return estimate
    reason = f"the recording is explained as well by {other:.3f} {why}"
    return replace(estimate, verdict="cannot tell", reason=reason)
