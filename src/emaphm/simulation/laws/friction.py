"""Dry friction after Borello: one speed update that sticks, breaks away and stops exactly."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.select import select


def speed_after(speed: Any, active: Any, static: Any, dynamic: Any, step_per_inertia: Any) -> Any:
    """Advance the shaft's speed by one step under dry friction with sticking.

    In motion, friction opposes the speed with f_d. At rest it balances the active torque up to f_s; beyond,
    the shaft breaks away against f_d. A step that would reverse the speed ends at rest, so that the next
    one decides afresh whether the shaft sticks:

        ω⁺ = ω + (τ - τ_f) Δt / J,   τ_f = f_d sgn ω   (ω ≠ 0)
                                     τ_f = τ           (ω = 0, |τ| ≤ f_s)
                                     τ_f = f_d sgn τ   (ω = 0, |τ| > f_s)
        ω⁺ = 0 where ω ω⁺ < 0

    Parameters
    ----------
    speed : ω, motor shaft, before the step [rad/s]
    active : τ, motor torque less load less viscous friction, at the motor shaft [N·m]
    static : f_s ≥ f_d, largest friction torque at rest [N·m]
    dynamic : f_d ≥ 0, friction torque in motion [N·m]
    step_per_inertia : Δt / J [s/(kg·m²)]

    Returns
    -------
    ω⁺, shaft speed after the step [rad/s].

    Notes
    -----
    First order in Δt; sticking and stopping are exact. No Stribeck curve between f_s and f_d, and no
    presliding displacement: `stribeck_factor` and `speed_through_standstill` have them.

    References
    ----------
    [1] L. Borello, M. D. L. Dalla Vedova: dry friction in servomechanisms; thesis, section 4.2, Fig. 4.2.
    """
    still = speed == 0.0
    against = np.copysign(dynamic, select(still, active, speed))
    friction = select(still & (np.abs(active) <= static), active, against)
    following = speed + (active - friction) * step_per_inertia
    return select(speed * following < 0.0, 0.0, following)


def dry_level(static: Any, dynamic: Any, transmitted: Any, at_low_speed: Any, stribeck: Any) -> Any:
    """Return the level of dry friction, which the friction torque has in motion.

        f = f_d + f_l + s (f_s - f_d + f_ls)

    Parameters
    ----------
    static, dynamic : f_s ≥ f_d, dry friction at rest and at speed, of the unloaded shaft [N·m]
    transmitted : f_l, what the transmitted torque adds (`transmitted_friction`) [N·m]
    at_low_speed : f_ls, what it adds at low speed beyond that [N·m]
    stribeck : s, share of the low-speed friction that is left (`stribeck_factor`) [-]

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
    """Return by what factor friction is larger in one direction than on average.

        1 + a sgn ω

    Parameters
    ----------
    speed : ω, or any quantity of its sign [rad/s]
    asymmetry : a, in (-1, 1): friction is (1 + a) / (1 - a) times as large forward as backward [-]

    Returns
    -------
    The factor [-].
    """
    return 1.0 + np.copysign(asymmetry, asymmetry * speed)
