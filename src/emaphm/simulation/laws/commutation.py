"""Trapezoidal commutation of a three-phase BLDC motor: shapes of back-EMF and current over the angle."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.select import select

RAMP = np.pi / 6
"""Half the width of a trapezoid's ramp: 30 degrees electrical [rad]."""


def from_zero(angle: Any) -> Any:
    """Return the distance of u in [-π, π) [rad] from the nearest zero of sin u: min(|u|, π - |u|) [rad]."""
    magnitude = np.abs(angle)
    return np.minimum(magnitude, np.pi - magnitude)


def trapezoid(angle: Any) -> Any:
    """Return the unit trapezoid: the shape of a phase's back-EMF and of its torque per ampere.

    It is odd, rises through 0 at 0 deg, is +1 from 30 to 150 deg and falls through 0 at 180 deg:

        s(u) = sgn(u) min(min(|u|, π - |u|) / (π/6), 1)

    Parameters
    ----------
    angle : u, electrical angle of the phase, in [-π, π) [rad]

    Returns
    -------
    s, in [-1, 1] [-].

    References
    ----------
    [1] Thesis, sections 2.2 and 3.1.3.
    """
    return np.copysign(np.minimum(from_zero(angle) / RAMP, 1.0), angle)


def demand_sign(angle: Any) -> Any:
    """Return the reference current of a phase, relative to the reference current of the drive.

        r(u) = sgn(u)   (π/6 ≤ |u| ≤ 5π/6: the flats of the trapezoid)
        r(u) = 0        otherwise: the phase idles

    Parameters
    ----------
    angle : u, electrical angle of the phase, in [-π, π) [rad]

    Returns
    -------
    r, one of -1, 0, +1 [-].

    References
    ----------
    [1] Thesis, section 3.1.3, Fig. 3.5.
    """
    return select(from_zero(angle) >= RAMP, np.copysign(1.0, angle), 0.0)


def of_idle_phase(angle: Any, values: Phases) -> Any:
    """Return the value that belongs to the idle phase.

    The trapezoid of the idle phase is nearest to a zero. With v = θ_e modulo π, in [0, π), the idle phase is

        a   (v ≤ π/6 or v ≥ 5π/6)
        c   (π/6 < v ≤ π/2)
        b   (π/2 < v < 5π/6)

    Parameters
    ----------
    angle : θ_e, electrical angle, in [-π, π) [rad]
    values : for each phase, the value to return while it idles, that is, while the two other phases conduct

    Returns
    -------
    The value of the idle phase.

    References
    ----------
    [1] Thesis, section 4.4: f(θ).
    """
    half_turn = select(angle < 0.0, angle + np.pi, angle)
    return select(from_zero(angle) <= RAMP, values.a, select(half_turn > np.pi / 2, values.b, values.c))
