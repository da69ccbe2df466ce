"""Controller of all models: from the command to the reference current or the duty cycle."""

from collections.abc import Callable
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.model import Initial
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.lag import approach, share_of_step
from emaphm.simulation.laws.position_loop import pid_speed_error, speed_error
from emaphm.simulation.laws.speed_loop import current_demand

PARAMETERS = (
    "position_gain",
    "speed_limit",
    "proportional",
    "integrating",
    "derivative",
    "demand_limit",
    "feedback_share",
    "position_integrating",
    "position_derivative",
    "command_share",
    "speed_feedforward",
    "speed_feedback",
)


NEUTRAL = {"integrating": 0.0, "derivative": 0.0, "feedback_share": 1.0}
"""Values of the thesis's actuator: a speed loop without integral and derivative, a feedback without lag."""


PARABOLA_S = 5e-3
"""Least duration of the command from which its acceleration at a start in motion is determined [s]. Of a
command in steps, a shorter duration would give the acceleration of a single step."""


def state_names(structure: Structure) -> tuple[str, ...]:
    """Return the names of the controller's state."""
    of_position = ("position_integral", "position_error", "commanded") if structure.position_pid else ()
    return ("feedback", "integral", "error", *of_position)


def parameters(plant: Plant, step: float) -> dict[str, Array]:
    """Return the controller's parameters, (n,) each.

    The output of the speed loop is a reference current; for a drive of kind "voltage", a duty cycle.
    """
    by_voltage = plant.structure.drive == "voltage"
    unit = np.ones(plant.count) if by_voltage else plant.drive_constant
    return {
        "position_gain": plant.position_gain,
        "speed_limit": plant.speed_limit,
        "proportional": plant.speed_gain / unit,
        "integrating": plant.integral_gain / unit,
        "derivative": plant.derivative_gain / unit / step,
        "demand_limit": np.ones(plant.count) if by_voltage else plant.current_limit,
        "feedback_share": share_of_step(plant.speed_lag, step),
        "position_integrating": plant.position_integral_gain,
        "position_derivative": plant.position_derivative_gain / step,
        "command_share": share_of_step(plant.command_lag, step),
        "speed_feedforward": plant.speed_feedforward,
        "speed_feedback": plant.speed_feedback,
    }


def initial_state(plant: Plant, inputs: Inputs, start: Initial) -> dict[str, Array]:
    """Return the controller's state at `start`, (n,) each, with integrals of 0.

    A drive that starts in motion has followed a parabola, which the command continues: lags of the feedback
    and of the command, and a feed-forward, have their values in that parabola after all transients.
    """
    zero, command, position = np.zeros(plant.count), inputs.command[0], plant.gear_ratio * start.angle
    measured, lagged, rate = zero + start.speed, zero + command, zero
    if start.speed:
        measured = (
            measured - plant.speed_lag * _parabola(plant, inputs, plant.speed_lag)[1] / plant.gear_ratio
        )
        slope, curvature = _parabola(plant, inputs, plant.command_lag)
        # Of a parabola c, a lag T leaves c - T dc/dt + T² d²c/dt².
        lagged = command - plant.command_lag * slope + plant.command_lag**2 * curvature
        rate = slope - plant.command_lag * curvature
    if not plant.structure.position_pid:
        error = speed_error(command - position, 0.0, measured, plant.position_gain, plant.speed_limit)
        return {"feedback": measured, "integral": zero, "error": zero + error}
    position_error = lagged - position
    error_rate = rate - plant.gear_ratio * start.speed
    error = pid_speed_error(
        position_error,
        0.0,
        error_rate,
        rate / plant.gear_ratio,
        measured,
        plant.position_gain,
        0.0,
        plant.position_derivative_gain,
        plant.speed_feedforward,
        plant.speed_feedback,
        plant.speed_limit,
    )
    return {
        "feedback": measured,
        "integral": zero,
        "error": zero + error,
        "position_integral": zero,
        "position_error": position_error - error_rate * inputs.step,
        "commanded": lagged - rate * inputs.step,
    }


def _parabola(plant: Plant, inputs: Inputs, lag: Array) -> tuple[Array, Array]:
    """Return rate (n,) and second derivative (n,) of the command at the start, in its unit per s and s².

    They are those of a parabola through the command over one `lag` (n,) [s], at least over `PARABOLA_S`; over
    two steps without a lag. The acceleration is at most that of the largest current: a step of the command is
    no motion before the start.
    """
    command = inputs.command
    if command.size < 3:
        return np.zeros(lag.shape), np.zeros(lag.shape)
    window = np.where(lag > 0, np.maximum(lag, PARABOLA_S), 0.0)
    half = np.clip(np.round(window / (2 * inputs.step)), 1, (command.size - 1) // 2).astype(int)
    first, middle, last, interval = command[0], command[half], command[2 * half], half * inputs.step
    largest = plant.gear_ratio * plant.current_limit * plant.torque_constant / plant.inertia
    curvature = np.clip((last - 2 * middle + first) / interval**2, -largest, largest)
    return (middle - first) / interval - curvature * interval / 2, curvature


def steady_current(plant: Plant, inputs: Inputs, start: Initial) -> Array:
    """Return the steady current of a drive that is in motion at `start`, (n,) [A].

    It is the current that the speed loop demands at `start`; 0 if the drive starts at rest.
    """
    if start.speed == 0.0:
        return np.zeros(plant.count)
    error = initial_state(plant, inputs, start)["error"]
    demanded = plant.speed_gain / plant.drive_constant * error
    return np.asarray(np.clip(demanded, -plant.current_limit, plant.current_limit))


def steady_voltage(plant: Plant, current: Array, speed: float) -> Array:
    """Return the voltage that maintains a `current` (n,) [A] at a `speed` [rad/s], (n,) [V], line to line.

        v = N (R i + k ω)

    N is the mean fraction of healthy turns; if the phases differ, the voltage varies about this value.
    """
    turns = plant.turns.mean(axis=0)
    return np.asarray(turns * (plant.resistance * current + plant.torque_constant * speed))


def control(structure: Structure) -> Callable[..., Any]:
    """Return the controller: a function of (state, parameters, inputs) that returns demand and next state."""
    return _pid if structure.position_pid else _proportional


def _proportional(s: Any, p: Any, u: Any) -> Any:
    measured = approach(s.feedback, s.speed, p.feedback_share)
    error = speed_error(u.command, p.gear_ratio * s.output, measured, p.position_gain, p.speed_limit)
    return _demand(s, p, error), (measured, u.enabled * (s.integral + error * u.step), error)


def _pid(s: Any, p: Any, u: Any) -> Any:
    measured = approach(s.feedback, s.speed, p.feedback_share)
    commanded = approach(s.commanded, u.command, p.command_share)
    position_error = commanded - p.gear_ratio * s.output
    error = pid_speed_error(
        position_error,
        s.position_integral,
        position_error - s.position_error,
        (commanded - s.commanded) / (u.step * p.gear_ratio),
        measured,
        p.position_gain,
        p.position_integrating,
        p.position_derivative,
        p.speed_feedforward,
        p.speed_feedback,
        p.speed_limit,
    )
    integrals = (u.enabled * (s.integral + error * u.step), error)
    position_integral = u.enabled * (s.position_integral + position_error * u.step)
    return _demand(s, p, error), (measured, *integrals, position_integral, position_error, commanded)


def _demand(s: Any, p: Any, error: Any) -> Any:
    """Return the demanded current [A] by the speed loop, of an `error` of the motor's speed [rad/s]."""
    return current_demand(
        error,
        s.integral,
        error - s.error,
        p.proportional,
        p.integrating,
        p.derivative,
        p.demand_limit,
    )
