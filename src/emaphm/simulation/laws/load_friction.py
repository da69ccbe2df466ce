"""Load-dependent friction: the loss of a gear or screw that is proportional to the transmitted torque."""

from typing import Any

import numpy as np


def transmitted_friction(motor: Any, external: Any, by_motor: Any, by_external: Any) -> Any:
    """Return the friction torque due to the transmitted torque.

        f_l = |K_m τ_m - K_e τ_e|

    Parameters
    ----------
    motor : τ_m, torque of the motor [N·m]
    external : τ_e, external torque on the shaft: the load torque with the opposite sign [N·m]
    by_motor, by_external : K_m, K_e ≥ 0, friction torque per torque of the motor, per external torque [-]

    Returns
    -------
    f_l ≥ 0, to be added to the level of dry friction [N·m].

    Notes
    -----
    With K_m = K_e = K_l this is K_l |τ_m - τ_e|: if the motor holds a load, both torques act on the flanks.
    The law implies the efficiencies of a screw. A motor that drives a steady load τ = -τ_e needs the torque
    (1 + K_e) / (1 - K_m) τ, so that the efficiency is (1 - K_m) / (1 + K_e). A motor that the load drives
    holds it with (1 - K_e) / (1 + K_m) τ. The screw is self-locking if K_e ≥ 1.

    References
    ----------
    [1] M. Duclusaud, G. Passault, V. Padois, O. Ly: Extended friction models for the physics simulation of
        servo actuators. arXiv 2410.08650, 2024: models M2 to M6.
    """
    return np.abs(by_motor * motor - by_external * external)
