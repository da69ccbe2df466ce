"""The voltage that an inverter loses between what its drive commands and the windings."""

from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.simulation.laws.select import clip

KNEE = 0.02
"""Current up to which the drop rises, relative to the drive's current limit [-]."""


def knees_per_ampere(current_limit: Array) -> Array:
    """Return 1 / i_0 (n,) [1/A], from the largest currents that drives demand (n,) [A]."""
    return np.asarray(1 / (KNEE * current_limit))


def voltage_drop(current: Any, full: Any, per_knee: Any) -> Any:
    """Return the voltage that switches and diodes take, against the current that they carry.

        v = V_d clip(i / i_0, -1, 1)

    Parameters
    ----------
    current : i [A]
    full : V_d ≥ 0, of all that the current passes [V]
    per_knee : 1 / i_0 > 0 [1/A]

    Returns
    -------
    v, which acts on the winding as one more back-EMF [V].

    Notes
    -----
    Dead time at a fixed PWM frequency takes voltage in the same way: V_dc t_d f at every sign of the current.
    The ramp stands for what diodes and ripple make of the change of sign; steeper than R it would not be
    stable at the averaged models' step.

    References
    ----------
    [1] S.-G. Jeong, M.-H. Park: The analysis and compensation of dead-time effects in PWM inverters, IEEE
        Transactions on Industrial Electronics 38(2), 1991.
    """
    return full * clip(current * per_knee, -1.0, 1.0)
