"""Kinematic backlash: the output rests until the input has crossed the gap (thesis 4.3)."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.inline import law


@law
def follow(output: Any, angle: Any, half_width: Any) -> Any:
    """Return the output [rad] after the input moved to `angle` [rad]: dragged along at the gap's edge."""
    return np.minimum(np.maximum(output, angle - half_width), angle + half_width)
