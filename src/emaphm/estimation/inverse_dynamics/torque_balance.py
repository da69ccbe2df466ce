"""Torque balance of a shaft: the motor's torque that the measured motion requires."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.inverse_dynamics.motion import Motion

NAMES = (
    "inertia",
    "viscous",
    "viscous_asymmetry",
    "coulomb",
    "static",
    "coulomb_asymmetry",
    "load_friction",
    "load_motor",
    "load_external",
    "stribeck_load_motor",
    "stribeck_load_external",
    "quadratic",
    "offset",
    "hinge",
    "gravity",
    "gravity_angle",
    "stribeck_speed",
    "transition_speed",
    "torque_constant",
    "resistance",
)
"""Lumped parameters that inverse dynamics can estimate, in addition to those of the torque ripple."""

LOADS = (
    *("load_friction", "load_motor", "load_external"),
    *("stribeck_load_motor", "stribeck_load_external"),
)
"""Parameters of load-dependent friction: the balance is not linear in them, and they are not negative."""

Values = Mapping[str, float]


def required_torque(motion: Motion, values: Values, ripple_orders: Sequence[float] = ()) -> Array:
    """Return the motor's torque that the measured motion requires, from the torque balance of a rigid shaft.

        τ = J α + C (1 + γ_v sgn ω) ω + Q ω |ω| + level σ + τ_load,   τ_m = τ - Σ (a_n cos nφ + b_n sin nφ)
        level = (1 + γ_c sgn ω) [F_c + |(l + l_m) τ - (l + l_e) τ_e| + s (F_s - F_c + |l'_m τ - l'_e τ_e|)]
        τ_load = τ_0 + K θ + G sin(θ + θ_0) + recorded load,   τ_e = -τ_load
        s = exp(-(ω / ω_s)²), 0 without a Stribeck speed;   σ = sgn ω, tanh(ω / ω_0) with a transition speed

    Without load-dependent friction, it is linear in J, C, Q, F_c, F_s, τ_0, K, G, a_n and b_n.

    Parameters
    ----------
    motion
        Measured ω [rad/s], α [rad/s²] and φ [rad] of the motor, θ [rad] of the user.
    values
        Lumped parameters by name, in their units: inertia J, viscous C, viscous_asymmetry γ_v,
        quadratic Q, coulomb F_c, static F_s, coulomb_asymmetry γ_c, load_friction l, load_motor l_m,
        load_external l_e, stribeck_load_motor l'_m, stribeck_load_external l'_e, stribeck_speed ω_s,
        transition_speed ω_0, offset τ_0, hinge K, gravity G, gravity_angle θ_0, ripple1_cos a_1,
        ripple1_sin b_1; missing values are 0.
    ripple_orders
        n, number of periods of each harmonic of the torque ripple per turn of the motor.

    Returns
    -------
    τ_m, shape (n,) [N·m].

    Notes
    -----
    The balance is not valid for a shaft at rest: friction then balances any torque up to static friction, and
    the motion does not determine it. Backlash, a compliant shaft and losses of motor and inverter are
    neglected. Load-dependent friction depends on the required torque, for which the balance is solved: with
    the measured torque, l_m near 1 would explain any torque by itself.

    References
    ----------
    [1] M. Gautier, W. Khalil: exciting trajectories for the identification of base inertial parameters of
        robots, Int. J. Robotics Research 11(4), 1992.
    [2] J. Swevers, W. Verdonck, J. De Schutter: dynamic model identification for industrial robots, IEEE
        Control Systems Magazine 27(5), 2007.
    [3] M. Duclusaud et al.: extended friction models for the physics simulation of servo actuators,
        arXiv 2410.08650, 2024: load-dependent friction.
    """

    def v(name: str) -> float:
        return values.get(name, 0.0)

    w, theta = motion.speed, motion.position
    sign = np.sign(w)
    through = np.tanh(w / v("transition_speed")) if v("transition_speed") > 0 else sign
    against = (1 + v("coulomb_asymmetry") * sign) * through
    stribeck = np.exp(-((w / v("stribeck_speed")) ** 2)) if v("stribeck_speed") > 0 else np.zeros_like(w)
    load = v("offset") + v("hinge") * theta + v("gravity") * np.sin(theta + v("gravity_angle")) + motion.load
    torque = v("inertia") * motion.acceleration + load
    torque += v("viscous") * (1 + v("viscous_asymmetry") * sign) * w + v("quadratic") * w * np.abs(w)
    torque += against * (v("coulomb") + stribeck * (v("static") - v("coulomb")))
    if any(v(name) for name in LOADS):
        torque = _with_loaded_friction(torque, load, against, stribeck * against, values)
    for i, order in enumerate(ripple_orders, start=1):
        torque -= v(f"ripple{i}_cos") * np.cos(order * motion.angle)
        torque -= v(f"ripple{i}_sin") * np.sin(order * motion.angle)
    return np.asarray(torque)


def _with_loaded_friction(
    torque: Array, load: Array, against: Array, at_low_speed: Array, values: Values
) -> Array:
    """Return the torque τ including the friction that it and the load cause, (n,) [N·m].

        τ = τ_0 + d |l_m τ + l_e τ_load| + d' |l'_m τ + l'_e τ_load|

    The equation is linear in τ for given signs of the absolute values; if |d| l_m + |d'| l'_m < 1, one pair
    of signs agrees with its own solution. `torque` is τ_0, `against` and `at_low_speed` are d and d' [-].
    """
    common, motor, external, low_motor, low_external = (values.get(name, 0.0) for name in LOADS)
    motor, external = common + motor, common + external
    solved = torque
    for sign, low_sign in itertools.product((1.0, -1.0), repeat=2):
        first, second = sign * against, low_sign * at_low_speed
        steepness = 1 - first * motor - second * low_motor
        candidate = (torque + (first * external + second * low_external) * load) / steepness
        agrees = sign * (motor * candidate + external * load) >= 0
        agrees &= low_sign * (low_motor * candidate + low_external * load) >= 0
        solved = np.where(agrees, candidate, solved)
    return np.asarray(solved)


def response(motion: Motion, torque: Array, values: Values) -> Array:
    """Return the recorded channel, a current [A] or voltage [V], for a motor's `torque` (n,) [N·m].

        i = τ / k,   u = k ω + R τ / k

    k is the torque constant [N·m/A] and, by conservation of power, the back-EMF constant; R is the resistance
    [ohm]. The time constant of the winding, about a millisecond, is neglected.
    """
    current = torque / values["torque_constant"]
    if motion.channel == "current_A":
        return current
    return np.asarray(values["torque_constant"] * motion.speed + values["resistance"] * current)


def measured_torque(motion: Motion, values: Values) -> Array:
    """Return the motor's torque (n,) [N·m] from the recorded channel: the inverse of `response`."""
    k = values["torque_constant"]
    if motion.channel == "current_A":
        return k * motion.response
    return np.asarray((motion.response - k * motion.speed) * k / values["resistance"])
