"""From an estimate and its covariance to a statement about each fault component."""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from emaphm.actuator import NAMES
from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array
from emaphm.diagnosis.result import Estimate
from emaphm.estimation.collinearity import Group
from emaphm.estimation.parameter_space import PRIOR_DEVIATION, FaultSpace
from emaphm.estimation.problem import noise_level

Z95 = 1.959963984540054
WIDEST_HALF_INTERVAL = 0.25
"""A component known less well than this is called not identifiable: the data leave half its range open."""

HARDLY_KNOWN = 0.7
"""Standard error, as a share of the prior's, from which on the data tell next to nothing."""

HEALTHY_MARGIN = 0.02
"""An interval this near to the healthy value counts as healthy: no model is right to a hundredth."""

HIDDEN = 0.1
"""A component is called healthy only where its interval leaves no room for a fault larger than this."""

ALLOWED = {False: (1.5, 0.05), True: (1.25, 0.02)}
"""Residual that a recording may leave without and with correction by the reference model.

As a multiple of the noise on it, and as a share of the current's rms. Of recordings that the reference
model made itself the correction leaves up to 1.17 times the noise, and nothing beyond 1.25 times.
"""


def estimates(
    space: FaultSpace, point: Array, covariance: Array, groups: Sequence[Group] = ()
) -> dict[str, Estimate]:
    """Return the eight components at `point` (d,) with intervals from `covariance` (d, d).

    Where nothing can be told of a component, its reason names the `groups` that it is a member of.
    """
    faults = space.faults(point)
    result = {}
    for i, name in enumerate(NAMES):
        if name in space.fixed:
            reason = space.fixed[name]
            result[name] = _untold(float(HEALTHY.vector[i]), PRIOR_DEVIATION, (0.0, 1.0), reason)
        elif i in (5, 6):
            continue
        else:
            column = space.columns.index(i)
            error = float(np.sqrt(covariance[column, column]))
            together = _together(name, groups)
            result[name] = _component(float(faults[i]), error, float(HEALTHY.vector[i]), together)
    if "eccentricity" not in space.fixed:
        result |= _eccentricity(space, point, covariance, _together("eccentricity", groups))
    return {name: result[name] for name in NAMES}


def _together(name: str, groups: Sequence[Group]) -> str:
    """Return why a member of a group cannot be told, nothing for another component."""
    others = [group.others(name) for group in groups if name in group.members]
    return f"only what it makes together with {others[0]} is known" if others else ""


def _untold(value: float, error: float, interval: tuple[float, float], reason: str) -> Estimate:
    return Estimate(value, error, interval, identifiable=False, verdict="cannot tell", reason=reason)


def _component(value: float, error: float, healthy: float, together: str = "") -> Estimate:
    """Return the estimate of a component: what its whole interval says of it, or that it says nothing."""
    half = Z95 * error
    low, high = interval = (max(value - half, 0.0), min(value + half, 1.0))
    identifiable = half <= WIDEST_HALF_INTERVAL
    reason = "" if identifiable else together or "this recording does not constrain it; more motion would"
    if error > HARDLY_KNOWN * PRIOR_DEVIATION:
        # Where nothing is told, the search has ended anywhere: so may the interval be.
        return _untold(value, error, (0.0, 1.0), reason)
    verdict: Literal["healthy", "degraded", "cannot tell"]
    if max(low - healthy, healthy - high) > HEALTHY_MARGIN:
        verdict = "degraded"
    elif max(high - healthy, healthy - low) <= HIDDEN:
        verdict = "healthy"
    else:
        verdict = "cannot tell"
        reason = reason or together or "its interval holds both the healthy value and faults that matter"
    return Estimate(value, error, interval, identifiable, verdict, reason)


def _eccentricity(
    space: FaultSpace, point: Array, covariance: Array, together: str
) -> Mapping[str, Estimate]:
    """Return radius and phase from their Cartesian form; the phase only where there is beyond doubt one."""
    x = space.columns.index(5)
    faults = space.faults(point)
    block = covariance[x : x + 2, x : x + 2]
    radius = float(faults[5])
    phase = float(faults[6])
    along = point[x : x + 2] / radius if radius > 0 else np.array([1.0, 0.0])
    across = np.array([-along[1], along[0]])
    radial = float(np.sqrt(along @ block @ along))
    turning = float(np.sqrt(across @ block @ across)) / (2 * np.pi * max(radius, 1e-12))
    half = Z95 * turning
    size = _component(radius, radial, healthy=0.0, together=together)
    if size.verdict != "degraded" or half > WIDEST_HALF_INTERVAL:
        reason = "no eccentricity beyond doubt, so its direction has no meaning"
        angle = _untold(phase, min(turning, float(PRIOR_DEVIATION)), (0.0, 1.0), reason)
    else:
        # A direction is neither good nor bad: it shares the verdict of the eccentricity itself.
        interval = (phase - half, phase + half)
        angle = Estimate(phase, turning, interval, identifiable=True, verdict=size.verdict)
    return {"eccentricity": size, "eccentricity_phase": angle}


def is_explained(recorded: Array, residual: Array, *, corrected: bool) -> bool:
    """Return whether `residual` (samples,) is no more than what noise and the model may leave, `ALLOWED`."""
    noise, share = ALLOWED[corrected]
    allowed = (noise * noise_level(recorded)) ** 2 + share**2 * float(np.mean(recorded**2))
    return bool(np.mean(residual**2) <= allowed)
