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
def phase_angles(angle: Any) -> Any:
    behind, ahead = angle - PHASE_SHIFT, angle + PHASE_SHIFT
    return (
        angle,
        select(behind < -np.pi, behind + 2 * np.pi, behind),
        select(ahead >= np.pi, ahead - 2 * np.pi, ahead),
    )


@law
def of_idle_phase(angle: Any, of_a: Any, of_b: Any, of_c: Any) -> Any:
    magnitude = np.abs(angle)
    from_zero = np.minimum(magnitude, np.pi - magnitude)
    half_turn = select(angle < 0.0, angle + np.pi, angle)
    return select(from_zero <= RAMP, of_a, select(half_turn > np.pi / 2, of_b, of_c))
