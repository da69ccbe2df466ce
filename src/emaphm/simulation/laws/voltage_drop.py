"""Voltage drop of an inverter: commanded voltage less voltage at the windings."""

from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.simulation.laws.select import clip

KNEE = 0.02
"""Current up to which the drop rises linearly, relative to the drive's current limit [-]."""


def knees_per_ampere(current_limit: Array) -> Array:
    """Return 1 / i_0 (n,) [1/A] for the current limits of the drives (n,) [A]."""
    return np.asarray(1 / (KNEE * current_limit))


def voltage_drop(current: Any, full: Any, per_knee: Any) -> Any:
    """Return the voltage drop of switches and diodes, which opposes the current.

        v = V_d clip(i / i_0, -1, 1)

    Parameters
    ----------
    current : i, current through switches and diodes [A]
    full : V_d ≥ 0, sum of the drops of all switches and diodes in the path of the current [V]
    per_knee : 1 / i_0 > 0, from `knees_per_ampere` [1/A]

    Returns
    -------
    v, which acts on the winding like an additional back-EMF [V].

    Notes
    -----
    Dead time t_d at a fixed PWM frequency f has the same effect: a drop of V_dc t_d f against the current.
    The ramp approximates the effect of diodes and ripple where the current changes its sign. A ramp steeper
    than R would be unstable at the step of the averaged models.

    References
    ----------
    [1] S.-G. Jeong, M.-H. Park: The analysis and compensation of dead-time effects in PWM inverters, IEEE
        Transactions on Industrial Electronics 38(2), 1991.
    """
    return full * clip(current * per_knee, -1.0, 1.0)
