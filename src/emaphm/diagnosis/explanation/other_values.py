"""Intervals that include the values of another, equally good explanation of the recording."""

from dataclasses import replace

import numpy as np

from emaphm.actuator.faults import HEALTHY
from emaphm.diagnosis.verdict import Estimate, verdict_of

OTHER_DIRECTION = 0.02
"""Smallest change that makes another direction; it must also exceed the half-width of the interval."""


def with_other_value(name: str, estimate: Estimate, first: Estimate, other: float, why: str) -> Estimate:
    """Return the `estimate` with the value of an alternative included in its interval.

    It is undecided if the verdict of that interval differs from `first`, the estimate without alternatives; a
    direction, if the directions differ. `why` states the condition under which the `other` value explains the
    recording. The alternative has the interval width of the first estimate.
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
    if name == "eccentricity_phase":  # a direction is neither healthy nor degraded
        is_contradicted = abs(other - first.value) > max(OTHER_DIRECTION, half_width)
    else:
        is_contradicted = verdict_of(interval, getattr(HEALTHY, name)) != first.verdict
    if first.verdict == "cannot tell" or not is_contradicted:
        return estimate
    reason = f"the recording is explained equally well by {other:.3f} {why}"
    return replace(estimate, verdict="cannot tell", reason=reason)
