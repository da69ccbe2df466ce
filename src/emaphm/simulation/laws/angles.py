"""Angles on the circle: wrapping them, shifting them from phase to phase, and turning a direction."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.select import select

PHASE_SHIFT = 2 * np.pi / 3
"""Electrical angle by which phase b lags phase a, and c lags b [rad]."""


def wrap(angle: Any) -> Any:
    """Return any angle [rad] turned into [-π, π): ((u + π) mod 2π) - π.

    Accurate to a rounding of the given angle. Not for kernels: a remainder is no vector instruction.
    """
    return np.mod(np.asarray(angle, float) + np.pi, 2 * np.pi) - np.pi


def wrap_once(angle: Any) -> Any:
    """Turn an angle that has left [-π, π) by less than one turn back into it.

        u = angle - 2π   (angle ≥ π)
        u = angle + 2π   (angle < -π)
        u = angle        elsewhere

    Parameters
    ----------
    angle : in [-3π, 3π) [rad]

    Returns
    -------
    u, in [-π, π) up to a rounding [rad].
    """
    angle = select(angle >= np.pi, angle - 2 * np.pi, angle)
    return select(angle < -np.pi, angle + 2 * np.pi, angle)


def phase_angles(angle: Any) -> Phases:
    """Return the electrical angle as each phase sees it.

        u_i = θ_e - 2π (i - 1) / 3,   i = 1, 2, 3 for the phases a, b, c, turned into [-π, π)

    Parameters
    ----------
    angle : θ_e, electrical angle, in [-π, π) [rad]

    Returns
    -------
    u_i, each in [-π, π) up to a rounding [rad].
    """
    behind, ahead = angle - PHASE_SHIFT, angle + PHASE_SHIFT
    return Phases(
        angle,
        select(behind < -np.pi, behind + 2 * np.pi, behind),
        select(ahead >= np.pi, ahead - 2 * np.pi, ahead),
    )


def turn(cos: Any, sin: Any, angle: Any) -> Any:
    """Turn a direction by a small angle, without a trigonometric function.

        cos⁺ = cos c - sin s,   c = 1 - δ²/2 + δ⁴/24
        sin⁺ = sin c + cos s,   s = δ - δ³/6 + δ⁵/120

    Parameters
    ----------
    cos, sin : of the angle before [-]
    angle : δ, by which it is turned [rad]

    Returns
    -------
    cos⁺, sin⁺, of the angle after [-].

    Notes
    -----
    Each turn adds δ⁶/720 to the length, relative, and -δ⁷/840 to the angle: at 8000 rpm and a step of 50 µs
    (δ = 0.042) 1.5e-8 of length after 0.1 s.
    """
    square = angle * angle
    by_cos = 1.0 - square * (0.5 - square * (1 / 24))
    by_sin = angle * (1.0 - square * (1 / 6 - square * (1 / 120)))
    return cos * by_cos - sin * by_sin, sin * by_cos + cos * by_sin
