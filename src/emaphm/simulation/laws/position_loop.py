"""The drive's outer loop: from the position error to a limited speed demand."""

from typing import Any

from emaphm.simulation.laws.inline import clip, law


@law
def speed_error(command: Any, position: Any, measured: Any, gain: Any, limit: Any) -> Any:
    """Return the speed that the drive demands, less the speed that it measures.

        e = clip(G_prop (θ_cmd - θ_user), -ω_max, ω_max) - ω_meas

    Parameters
    ----------
    command : θ_cmd, demanded position of the user [rad]
    position : θ_user, position of the user [rad]
    measured : ω_meas, motor speed as the drive measures it [rad/s]
    gain : G_prop, position gain, motor speed per position error of the user [1/s]
    limit : ω_max, largest speed demand [rad/s]

    Returns
    -------
    e, speed error at the motor [rad/s].

    Notes
    -----
    Algebraic: the position is that at the start of the step. A gain fault multiplies G_prop.

    References
    ----------
    [1] Thesis, section 3.1.2, Fig. 3.3.
    """
    return clip(gain * (command - position), -limit, limit) - measured
