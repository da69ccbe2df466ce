"""Motion of the shaft: from torque to speed, angle and the user's side of the gap, between end stops."""

from typing import Any

from emaphm.simulation.laws.backlash import follow
from emaphm.simulation.laws.friction import speed_after
from emaphm.simulation.laws.inline import clip, law, select


@law
def move(
    speed: Any,
    angle: Any,
    output: Any,
    torque: Any,
    viscous: Any,
    static: Any,
    dynamic: Any,
    half_gap: Any,
    low_stop: Any,
    high_stop: Any,
    step: Any,
    step_per_inertia: Any,
) -> Any:
    """Advance speed, motor angle and user-side angle by one step.

    The speed first, the angle with the new speed (semi-implicit Euler), then the backlash:

        ω⁺ = speed_after(ω, T - C ω, f_s, f_d, Δt / J)
        θ' = θ + ω⁺ Δt,   θ⁺ = min(max(θ', θ_low - b), θ_high + b)
        ω⁺ = 0 where θ⁺ ≠ θ'
        θ_u⁺ = follow(θ_u, θ⁺, b)

    The stops hold the user's side. A shaft at a stop has speed 0 for as long as the torque pushes outward.

    Parameters
    ----------
    speed : ω, motor shaft [rad/s]
    angle : θ, motor shaft [rad]
    output : θ_u, user's side of the gap, referred to the motor [rad]
    torque : T, the motor's less the load, at the motor shaft [N·m]
    viscous : C ≥ 0, viscous friction coefficient [N·m·s/rad]
    static, dynamic : f_s ≥ f_d ≥ 0, dry friction at rest and in motion [N·m]
    half_gap : b ≥ 0, half the backlash [rad]
    low_stop, high_stop : θ_low < θ_high, stops of the user, referred to the motor [rad]
    step : Δt [s]
    step_per_inertia : Δt / J, J of motor and user together [s/(kg·m²)]

    Returns
    -------
    ω⁺ [rad/s], θ⁺ [rad], θ_u⁺ [rad].

    Notes
    -----
    First order in Δt. Viscous friction is taken explicitly: stable for Δt < 2 J / C. Motor and user are one
    inertia, also inside the gap; the shaft is rigid, and stops take no rebound.

    References
    ----------
    [1] Thesis, section 3.1, Fig. 3.13, and sections 4.2, 4.3.
    """
    free = speed_after(speed, torque - viscous * speed, static, dynamic, step_per_inertia)
    reached = angle + free * step
    held = clip(reached, low_stop - half_gap, high_stop + half_gap)
    return select(held == reached, free, 0.0), held, follow(output, held, half_gap)
