"""Load torque of a weight on an arm."""

from typing import Any


def gravity_load(cos: Any, sin: Any, along: Any, across: Any) -> Any:
    """Return the load torque of a weight on an arm that turns with the user.

        τ_l = M sin(θ_u + θ_0) = (M cos θ_0) sin θ_u + (M sin θ_0) cos θ_u,   M = m g l τ

    Positive load opposes positive motion. At θ_u + θ_0 = 0 the weight hangs vertically below the axis, and
    motion in both directions lifts it.

    Parameters
    ----------
    cos, sin : cosine and sine of θ_u, position of the user [-]
    along, across : M cos θ_0, M sin θ_0, with mass m, gravity g, arm l and gear ratio τ [N·m at the motor]

    Returns
    -------
    τ_l, load torque at the motor [N·m].
    """
    return along * sin + across * cos
