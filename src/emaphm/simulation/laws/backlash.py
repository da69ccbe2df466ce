"""Kinematic backlash: the output rests until the input has crossed the gap."""

from typing import Any

import numpy as np


def follow(output: Any, angle: Any, half_width: Any) -> Any:
    """Return the position of the output side of a gap after its input side has moved.

    The output rests while the input is inside the gap. At an edge of the gap, the input moves the output:

        θ_u⁺ = min(max(θ_u, θ - b), θ + b),   b = BLK / 2

    Parameters
    ----------
    output : θ_u, position of the output side before the step [rad]
    angle : θ, position of the input side after the step [rad]
    half_width : b ≥ 0, half of the gap's full width BLK [rad]

    Returns
    -------
    θ_u⁺, position of the output side after the step [rad].

    Notes
    -----
    Exact for any step in which the input does not reverse. Kinematic: the output has no inertia of its own;
    the edges of the gap are rigid and without rebound.

    References
    ----------
    [1] Simulink, block "Backlash".
    [2] Thesis, section 4.3.
    """
    return np.minimum(np.maximum(output, angle - half_width), angle + half_width)
