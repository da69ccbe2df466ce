"""Dry friction after Borello: a speed update in which sticking, breakaway and stopping are exact."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.select import select


def speed_after(speed: Any, active: Any, static: Any, dynamic: Any, step_per_inertia: Any) -> Any:
    """Return the shaft's speed after one step under dry friction with sticking.

    In motion, friction opposes the speed with f_d. At rest, friction balances the active torque up to f_s;
    above f_s the shaft breaks away against f_d. A step that would reverse the speed ends at rest, so that the
    next step decides again whether the shaft sticks:

        ω⁺ = ω + (τ - τ_f) Δt / J,   τ_f = f_d sgn ω   (ω ≠ 0)
                                     τ_f = τ           (ω = 0, |τ| ≤ f_s)
                                     τ_f = f_d sgn τ   (ω = 0, |τ| > f_s)
        ω⁺ = 0 where ω ω⁺ < 0

    Parameters
    ----------
    speed : ω, speed of the motor shaft before the step [rad/s]
    active : τ, motor torque less load less viscous friction, at the motor shaft [N·m]
    static : f_s ≥ f_d, largest friction torque at rest [N·m]
    dynamic : f_d ≥ 0, friction torque in motion [N·m]
    step_per_inertia : Δt / J [s/(kg·m²)]

    Returns
    -------
    ω⁺, shaft speed after the step [rad/s].

    Notes
    -----
    First order in Δt; sticking and stopping are exact. The law has no Stribeck curve between f_s and f_d (see
    `stribeck_factor`) and no presliding displacement (see `speed_against_bristles`).

    References
    ----------
    [1] L. Borello, M. D. L. Dalla Vedova: dry friction in servomechanisms; thesis, section 4.2, Fig. 4.2.
    """
    at_rest = speed == 0.0
    dynamic_torque = np.copysign(dynamic, select(at_rest, active, speed))
    friction = select(at_rest & (np.abs(active) <= static), active, dynamic_torque)
    following = speed + (active - friction) * step_per_inertia
    return select(speed * following < 0.0, 0.0, following)


def dry_level(static: Any, dynamic: Any, transmitted: Any, at_low_speed: Any, stribeck: Any) -> Any:
    """Return the level of dry friction: the friction torque in motion.

        f = f_d + f_l + s (f_s - f_d + f_ls)

    Parameters
    ----------
    static, dynamic : f_s ≥ f_d, dry friction of the unloaded shaft at rest and at speed [N·m]
    transmitted : f_l, friction due to the transmitted torque (`transmitted_friction`) [N·m]
    at_low_speed : f_ls, additional friction due to the transmitted torque at low speed [N·m]
    stribeck : s, factor of the low-speed friction, in [0, 1] (`stribeck_factor`) [-]

    Returns
    -------
    f, level of dry friction [N·m].

    References
    ----------
    [1] M. Duclusaud, G. Passault, V. Padois, O. Ly: Extended friction models for the physics simulation of
        servo actuators. arXiv 2410.08650, 2024: models M4 to M6.
    """
    return dynamic + transmitted + stribeck * (static - dynamic + at_low_speed)


def directional(speed: Any, asymmetry: Any) -> Any:
    """Return the factor of direction-dependent friction, relative to the mean of both directions.

        1 + a sgn ω

    Parameters
    ----------
    speed : ω, or any quantity with the sign of ω [rad/s]
    asymmetry : a, in (-1, 1): forward friction is (1 + a) / (1 - a) times the backward friction [-]

    Returns
    -------
    The factor [-].
    """
    return 1.0 + np.copysign(asymmetry, asymmetry * speed)
