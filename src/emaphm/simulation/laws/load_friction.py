"""Load-dependent friction: what a gear or screw loses of the torque that it transmits."""

from typing import Any

import numpy as np


def transmitted_friction(motor: Any, external: Any, by_motor: Any, by_external: Any) -> Any:
    """Return the friction torque that the transmitted torque causes.

        f_l = |K_m τ_m - K_e τ_e|

    Parameters
    ----------
    motor : τ_m, torque of the motor [N·m]
    external : τ_e, external torque on the shaft, that of the load with its sign turned [N·m]
    by_motor, by_external : K_m, K_e ≥ 0, friction per torque [-]

    Returns
    -------
    f_l ≥ 0, to be added to the level of dry friction [N·m].

    Notes
    -----
    With K_m = K_e = K_l this is K_l |τ_m - τ_e|: a motor that holds a load has it all on the flanks. The
    efficiencies of a screw are this law: driving a steady load τ = -τ_e the motor gives
    (1 + K_e) / (1 - K_m) τ, so that the efficiency is (1 - K_m) / (1 + K_e); driven by the load it holds it
    with (1 - K_e) / (1 + K_m) τ, and the screw is self-locking where K_e ≥ 1.

    References
    ----------
    [1] M. Duclusaud, G. Passault, V. Padois, O. Ly: Extended friction models for the physics simulation of
        servo actuators. arXiv 2410.08650, 2024: models M2 to M6.
    """
    return np.abs(by_motor * motor - by_external * external)
