"""Compliant shaft: a damped spring between motor and user, with the backlash as a dead zone in series."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.select import clip, select


def shaft_torque(twist: Any, rate: Any, half_gap: Any, stiffness: Any, damping: Any) -> Any:
    """Return the torque that the shaft transmits from the motor to the user.

    Inside the gap the torque is 0. Beyond an edge of the gap, a spring and a damper act in parallel. They
    push but do not pull: τ_s never has the sign opposite to ε.

        ε = δ - clip(δ, -b, b)
        τ_s = max(k ε + d δ̇, 0)   (ε > 0)
        τ_s = min(k ε + d δ̇, 0)   (ε < 0)
        τ_s = 0                   (ε = 0)

    Parameters
    ----------
    twist : δ = θ - θ_u, angle of the motor less angle of the user, both referred to the motor [rad]
    rate : δ̇, time derivative of the twist [rad/s]
    half_gap : b ≥ 0, half the backlash [rad]
    stiffness, damping : k > 0 [N·m/rad], d ≥ 0 [N·m·s/rad]

    Returns
    -------
    τ_s, torque that drives the user and brakes the motor [N·m].

    References
    ----------
    [1] M. Nordin, P.-O. Gutman: Controlling mechanical systems with backlash, a survey. Automatica
        38(10), 2002.
    """
    beyond = twist - clip(twist, -half_gap, half_gap)
    pushing = stiffness * beyond + damping * rate
    return select(beyond > 0.0, np.maximum(pushing, 0.0), select(beyond < 0.0, np.minimum(pushing, 0.0), 0.0))
