"""Position loop of the drive: from the position error to a limited speed demand."""

from typing import Any

from emaphm.simulation.laws.select import clip


def speed_error(command: Any, position: Any, measured: Any, gain: Any, limit: Any) -> Any:
    """Return the speed error: the speed demand of a proportional position loop, less the measured speed.

        e = clip(G_prop (θ_cmd - θ_user), -ω_max, ω_max) - ω_meas

    Parameters
    ----------
    command : θ_cmd, commanded position of the user [rad]
    position : θ_user, position of the user [rad]
    measured : ω_meas, motor speed as the drive measures it [rad/s]
    gain : G_prop, position gain, motor speed per position error of the user [1/s]
    limit : ω_max, largest speed demand [rad/s]

    Returns
    -------
    e, speed error at the motor [rad/s].

    Notes
    -----
    Algebraic: the position is the position at the start of the step. A gain fault multiplies G_prop.

    References
    ----------
    [1] Thesis, section 3.1.2, Fig. 3.3.
    """
    return clip(gain * (command - position), -limit, limit) - measured


def pid_speed_error(
    error: Any,
    integral: Any,
    difference: Any,
    rate: Any,
    measured: Any,
    gain: Any,
    integrating: Any,
    derivative: Any,
    feedforward: Any,
    feedback: Any,
    limit: Any,
) -> Any:
    """Return the speed error: the speed demand of a PID position loop with feed-forward, less measured speed.

        e = clip(G_prop (ε + ∫ε dt / T_i + T_d dε/dt) + k_ff θ̇_cmd / τ, -ω_max, ω_max) - β ω_meas

    Parameters
    ----------
    error : ε, position error of the user [rad]
    integral : ∫ε dt up to the previous step [rad·s]
    difference : ε less its value one step before [rad]
    rate : θ̇_cmd / τ, rate of the command divided by the gear ratio, as a motor speed [rad/s]
    measured : ω_meas, motor speed as the drive measures it [rad/s]
    gain : G_prop [1/s]
    integrating : 1 / T_i [1/s]
    derivative : T_d / Δt [-]
    feedforward : k_ff, 1 if the full rate of the command is fed forward [-]
    feedback : β, 1 for a drive with a speed loop around the motor, 0 for a drive without a speed loop [-]
    limit : ω_max, largest speed demand [rad/s]

    Returns
    -------
    e, input of the speed loop [rad/s].

    Notes
    -----
    The integral has no anti-windup. A gain fault multiplies G_prop, and thus all three parts.
    """
    demand = gain * (error + integrating * integral + derivative * difference) + feedforward * rate
    return clip(demand, -limit, limit) - feedback * measured
