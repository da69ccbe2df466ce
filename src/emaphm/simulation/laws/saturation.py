"""Magnetic saturation: a torque constant that falls with the current."""

from typing import Any

import numpy as np

LEAST = 0.1
"""Least factor of the flux [-]: the torque constant remains positive at any current."""


def flux_left(saturation: Any, current: Any) -> Any:
    """Return the factor of a current on the magnets' flux.

        g = max(1 - κ |i|, 1/10)

    Parameters
    ----------
    saturation : κ, relative loss of flux per ampere; negative if the flux appears to rise [1/A]
    current : i, of the two conducting phases, or the length of the current vector of all three [A]

    Returns
    -------
    g, factor of both the torque constant and the back-EMF constant, so that e i = T ω [-].

    Notes
    -----
    First term of a series: adequate for a motor that loses a fifth of its flux at its largest current, but
    not for iron that saturates abruptly. The change of the stored magnetic energy is neglected. A current
    sensor that shows too little at large currents has the same effect as κ < 0.

    References
    ----------
    [1] D. C. Hanselman: Brushless permanent magnet motor design, 2nd ed., 2003, on armature reaction.
    """
    return np.maximum(1.0 - saturation * np.abs(current), LEAST)
