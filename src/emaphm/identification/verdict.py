"""From an estimate and its covariance to a statement about each fault component."""

from collections.abc import Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import NAMES
from emaphm.actuator.faults import HEALTHY
from emaphm.identification.correction import PRIOR_DEVIATION
from emaphm.identification.diagnosis import Estimate
from emaphm.identification.problem import noise_level
from emaphm.identification.space import FaultSpace

Array = NDArray[np.float64]

Z95 = 1.959963984540054
WIDEST_HALF_INTERVAL = 0.25
"""A component known less well than this is called not identifiable: the data leave half its range open."""

HEALTHY_MARGIN = 0.02
"""An interval this near to the healthy value counts as healthy: no model is right to a hundredth."""

NOISE_MARGIN = 1.5
"""Residual, as a multiple of the noise on the recording, that noise alone may make."""

UNEXPLAINED_SHARE = 0.05
"""Residual, as a share of the current's rms, beyond which the model does not explain a recording."""


def estimates(space: FaultSpace, point: Array, covariance: Array) -> dict[str, Estimate]:
    """Return the eight components at `point` (d,) with intervals from `covariance` (d, d)."""
    faults = space.faults(point)
    result = {}
    for i, name in enumerate(NAMES):
        if name in space.fixed:
            reason = space.fixed[name]
            result[name] = _unknown(float(HEALTHY.vector[i]), PRIOR_DEVIATION, (0.0, 1.0), reason)
        elif i in (5, 6):
            continue
        else:
            column = space.columns.index(i)
            error = float(np.sqrt(covariance[column, column]))
            result[name] = _component(float(faults[i]), error, float(HEALTHY.vector[i]))
    if "eccentricity" not in space.fixed:
        result |= _eccentricity(space, point, covariance)
    return {name: result[name] for name in NAMES}


def _unknown(value: float, error: float, interval: tuple[float, float], reason: str) -> Estimate:
    return Estimate(value, error, interval, identifiable=False, verdict="unknown", reason=reason)


def _component(value: float, error: float, healthy: float) -> Estimate:
    half = Z95 * error
    interval = (max(value - half, 0.0), min(value + half, 1.0))
    if half > WIDEST_HALF_INTERVAL:
        return _unknown(value, error, interval, "this recording does not constrain it; more motion would")
    distance = max(interval[0] - healthy, healthy - interval[1])
    verdict: Literal["healthy", "degraded"] = "healthy" if distance <= HEALTHY_MARGIN else "degraded"
    return Estimate(value, error, interval, identifiable=True, verdict=verdict)


def _eccentricity(space: FaultSpace, point: Array, covariance: Array) -> Mapping[str, Estimate]:
    """Return radius and phase from their Cartesian form; the phase only where the radius is beyond doubt."""
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
    size = _component(radius, radial, healthy=0.0)
    if size.verdict != "degraded" or half > WIDEST_HALF_INTERVAL:
        reason = "no eccentricity beyond doubt, so its direction has no meaning"
        angle = _unknown(phase, min(turning, float(PRIOR_DEVIATION)), (0.0, 1.0), reason)
    else:
        # A direction is neither good nor bad: it shares the verdict of the eccentricity itself.
        interval = (phase - half, phase + half)
        angle = Estimate(phase, turning, interval, identifiable=True, verdict=size.verdict)
    return {"eccentricity": size, "eccentricity_phase": angle}


def is_explained(recorded: Array, residual: Array) -> bool:
    """Return whether `residual` (samples,) is little more than noise and 5 % of the current's rms."""
    allowed = (NOISE_MARGIN * noise_level(recorded)) ** 2 + UNEXPLAINED_SHARE**2 * float(np.mean(recorded**2))
    return bool(np.mean(residual**2) <= allowed)
