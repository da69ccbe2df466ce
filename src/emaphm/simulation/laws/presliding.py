"""Dry friction with presliding: bristles that act as springs up to the friction level (Dahl, LuGre)."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.select import select

LEAST_BRAKING = 1e-12
"""Least change of the speed by the full friction in a step [rad/s]; avoids a division by 0."""


def speed_against_bristles(free: Any, braking: Any, held: Any, give: Any, damping: Any) -> Any:
    """Return the speed after a step against bristle friction, and the bristles' spring force after it.

    Bristles of stiffness σ_0 and damping σ_1 have the deflection z, and slide at the friction level f:

        ż = ω - (σ_0 / f) |ω| z,   friction = σ_0 z + σ_1 ż

    Backward Euler, with q = σ_0 z Δt / J, κ = σ_0 Δt² / J, η = σ_1 Δt / J, β = f Δt / J, s = sgn(ω_0 - q):

        (1 + (κ/β) |ω⁺|) q⁺ = q + κ ω⁺,   ω⁺ + q⁺ + (η/κ) (q⁺ - q) = ω_0
        (κ/β) |ω⁺|² + (1 + κ + η - (κ/β) s (ω_0 + (η/κ) q)) |ω⁺| = s (ω_0 - q),   sgn ω⁺ = s

    Parameters
    ----------
    free : ω_0, speed after the step without dry friction [rad/s]
    braking : β ≥ 0, change of the speed in the step by friction of the full level [rad/s]
    held : q, change of the speed in the step by the bristles' spring force σ_0 z [rad/s]
    give : κ > 0, square of the bristles' natural frequency times the step [-]
    damping : η ≥ 0, relative change of the speed in the step by the bristles' damping [-]

    Returns
    -------
    ω⁺, speed after the step, and q⁺, from which z⁺ = q⁺ J / (σ_0 Δt) [rad/s].

    Notes
    -----
    Stable for any step: the equation has one solution with the sign s. Of the two forms of its root, the code
    uses the form without cancellation. Under a constant torque below f the shaft comes to rest with deflected
    bristles.

    References
    ----------
    [1] P. R. Dahl: A solid friction model. Aerospace Corporation, TOR-0158(3107-18), 1968: without damping.
    [2] C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky: A new model for control of systems with
        friction. IEEE Trans. Automatic Control 40, 1995.
    """
    steepness = give / np.maximum(braking, LEAST_BRAKING)
    side = np.copysign(1.0, free - held)
    against = side * (free - held)
    linear = 1.0 + give + damping - steepness * side * (free + damping / give * held)
    discriminant_root = np.sqrt(linear * linear + 4.0 * steepness * against)
    positive = linear > 0.0
    numerator = select(positive, 2.0 * against, discriminant_root - linear)
    denominator = select(positive, linear + discriminant_root, 2.0 * steepness)
    size = numerator / denominator
    after = side * size
    return after, (held + give * after) / (1.0 + steepness * size)
