"""A torque constant that falls with the current."""

from typing import Any

import numpy as np

LEAST = 0.1
"""Least share of the flux that is left, so that a motor stays a motor at any current."""


def flux_left(saturation: Any, current: Any) -> Any:
    """Return the share of the magnets' flux that a current leaves.

        max(1 - κ |i|, 1/10)

    Parameters
    ----------
    saturation : κ, loss per ampere; below 0 where the flux seems to rise [1/A]
    current : i, of the two conducting phases, or the length of the vector of all three [A]

    Returns
    -------
    The factor on torque constant and back-EMF constant alike [-], which keeps e i = T ω.

    Notes
    -----
    First term of a series: a motor that loses a fifth at its largest current is well described by it, an iron
    that gives way suddenly is not. What the flux stores is left out. Sensors that show too little of large
    currents look the same, with κ < 0.

    References
    ----------
    [1] D. C. Hanselman: Brushless permanent magnet motor design, 2nd ed., 2003, on armature reaction.
    """
    return np.maximum(1.0 - saturation * np.abs(current), LEAST)
