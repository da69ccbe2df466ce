"""Kinematic backlash: the output rests until the input has crossed the gap."""

from typing import Any

import numpy as np


def follow(output: Any, angle: Any, half_width: Any) -> Any:
    """Return where a gap's output side is after its input side has moved.

    The output rests while the input is inside the gap, and is carried along at the gap's edge:

        θ_u⁺ = min(max(θ_u, θ - b), θ + b),   b = BLK / 2

    Parameters
    ----------
    output : θ_u, the output side before the step [rad]
    angle : θ, the input side after the step [rad]
    half_width : b ≥ 0, half of the gap's full width BLK [rad]

    Returns
    -------
    θ_u⁺, the output side after the step [rad].

    Notes
    -----
    Exact for any step, as long as the input does not turn back within it. Kinematic: the output has no
    inertia of its own, and the gap's edge neither gives nor bounces.

    References
    ----------
    [1] Simulink, block "Backlash".
    [2] Thesis, section 4.3.
    """
    return np.minimum(np.maximum(output, angle - half_width), angle + half_width)
