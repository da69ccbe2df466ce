"""A shaft that gives: a damped spring between motor and user, the backlash as a dead zone in series."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.select import clip, select


def shaft_torque(twist: Any, rate: Any, half_gap: Any, stiffness: Any, damping: Any) -> Any:
    """Return the torque that the motor passes to the user.

    Inside the gap nothing; at its edges spring and damper in parallel, which push but do not pull:

        ε = δ - clip(δ, -b, b),   τ_s = k ε + d δ̇ where ε ≠ 0 and of the sign of ε, else 0

    Parameters
    ----------
    twist : δ = θ - θ_u, by which the motor is ahead of the user, both referred to the motor [rad]
    rate : δ̇ [rad/s]
    half_gap : b ≥ 0, half the backlash [rad]
    stiffness, damping : k > 0 [N·m/rad], d ≥ 0 [N·m·s/rad]

    Returns
    -------
    τ_s, torque from the motor to the user [N·m].

    References
    ----------
    [1] M. Nordin, P.-O. Gutman: Controlling mechanical systems with backlash, a survey. Automatica
        38(10), 2002.
    """
    beyond = twist - clip(twist, -half_gap, half_gap)
    pushing = stiffness * beyond + damping * rate
    return select(beyond > 0.0, np.maximum(pushing, 0.0), select(beyond < 0.0, np.minimum(pushing, 0.0), 0.0))
