"""Trapezoidal commutation of a three-phase BLDC motor (thesis 2.2, 3.1.3).

Electrical angles are wrapped to [-pi, pi). Phase i (0, 1, 2) sees the angle shifted by -2 pi i / 3.
"""

from typing import Any

import numpy as np

from emaphm.simulation.laws.inline import law, select

PHASE_SHIFT = 2 * np.pi / 3
RAMP = np.pi / 6


@law
def wrap_once(angle: Any) -> Any:
    """Return an angle [rad] in [-3 pi, 3 pi) turned into [-pi, pi)."""
    angle = select(angle >= np.pi, angle - 2 * np.pi, angle)
    return select(angle < -np.pi, angle + 2 * np.pi, angle)


def wrap(angle: Any) -> Any:
    """Return any angle [rad] turned into [-pi, pi)."""
    return np.mod(np.asarray(angle, float) + np.pi, 2 * np.pi) - np.pi


@law
def trapezoid(angle: Any) -> Any:
    """Return the unit trapezoid s of a wrapped electrical angle [rad].

    It rises through 0 at 0 deg, is +1 from 30 to 150 deg, and odd.
    """
    magnitude = np.abs(angle)
    from_zero = np.minimum(magnitude, np.pi - magnitude)
    return np.copysign(np.minimum(from_zero / RAMP, 1.0), angle)


@law
def demand_sign(angle: Any) -> Any:
    """Return r, the share of the reference current asked of a phase: the sign of a flat, 0 on a ramp."""
    magnitude = np.abs(angle)
    from_zero = np.minimum(magnitude, np.pi - magnitude)
    return select(from_zero >= RAMP, np.copysign(1.0, angle), 0.0)


@law
def idle_phase(angle: Any) -> Any:
    """Return three weights, 1 for the phase that idles at a wrapped electrical angle [rad], else 0.

    It is the phase nearest to a zero of its trapezoid; exactly one weight is 1 at any angle.
    """
    a = np.abs(angle)
    b = np.abs(wrap_once(angle - PHASE_SHIFT))
    c = np.abs(wrap_once(angle + PHASE_SHIFT))
    a, b, c = np.minimum(a, np.pi - a), np.minimum(b, np.pi - b), np.minimum(c, np.pi - c)
    idle_a = select((a <= b) & (a <= c), 1.0, 0.0)
    idle_b = select(b <= c, 1.0 - idle_a, 0.0)
    return idle_a, idle_b, 1.0 - idle_a - idle_b
