"""Check of the described controller against a recording."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.actuator.quantity import unit_for
from emaphm.arrays import Array
from emaphm.errors import RecordingError
from emaphm.estimation.inverse_dynamics.filtering import FilterFrequencies, first_order_lag, low_pass
from emaphm.estimation.inverse_dynamics.result import ParameterEstimate
from emaphm.estimation.sensors.ideal_sensors import as_by_ideal_sensors
from emaphm.estimation.uncertainty.covariance import sandwich_covariance
from emaphm.random_streams import stream
from emaphm.recording import Recording, with_equivalent_current
from emaphm.recording.noise import noise_level, rounding_step

GAIN_TOLERANCE = 0.1
"""Largest relative deviation of a gain from its description that is no contradiction: an undescribed lag of
half a millisecond changes the estimate by 4.5 % (`examples/emps`)."""

SIGNIFICANT = 3.0
"""Number of standard errors beyond the tolerance above which a deviation is significant."""

OTHER_LAW = 0.25
"""Relative error of the current with the best gains above which the control law itself differs."""

LEAST_ROWS = 20
"""Least number of rows without a limit for an estimation of the gains."""

MOST_CONDITION = 1e6
"""Largest condition number of the scaled regressors; above it they are collinear."""

LIMITED = 0.98
"""Share of a limit above which a demand counts as limited: such rows do not identify the gains."""

_Estimates: TypeAlias = tuple[ParameterEstimate | None, ParameterEstimate | None]
"""The position gain and the speed gain."""

_Allowance: TypeAlias = Callable[
    [ParameterEstimate | None, ParameterEstimate | None], ParameterEstimate | None
]
"""Maps a gain and a second estimate of it to the gain with a larger standard error."""


@dataclass(frozen=True)
class ControllerCheck:
    """Comparison of the described control law with a recording.

    `relative_error` is rms(recorded - predicted) / rms(recorded) of the current with the described gains,
    `best_error` that with the best-fitting `position_gain` and `speed_gain`. The last three are None if the
    recording does not identify the gains, or if their sign is wrong. `described` are the described gains, the
    position gain first.

    The current is a small difference of two large terms, so that an error of a gain of 1 % may cause a
    `relative_error` of 1: a contradiction is therefore decided by the gains.
    """

    relative_error: float
    best_error: float | None
    position_gain: ParameterEstimate | None
    speed_gain: ParameterEstimate | None
    described: tuple[float, float]

    @property
    def contradicts(self) -> bool:
        """Whether the described gains, or the form of the control law, contradict the recording."""
        gains = (self.position_gain, self.speed_gain)
        if not any(gains):
            return self.relative_error > OTHER_LAW
        return bool(self.deviating) or (self.best_error or 0.0) > OTHER_LAW

    @property
    def gains_contradict(self) -> bool:
        """Whether gains that differ from the description explain the recording.

        Noise of the position reduces the gains from the regression (errors in variables); their standard
        errors allow for it.
        """
        return bool(self.deviating) and self.best_error is not None and self.best_error <= OTHER_LAW

    @property
    def deviating(self) -> tuple[str, ...]:
        """The gains that deviate significantly from their description, in words with their estimates."""
        gains = zip(
            ("position gain", "speed gain"),
            (self.position_gain, self.speed_gain),
            self.described,
            strict=True,
        )
        return tuple(
            f"{name} {gain.value:.4g} ± {gain.standard_error:.1g} {gain.unit}, described {described:.4g}"
            for name, gain, described in gains
            if gain is not None
            and abs(gain.value - described) - SIGNIFICANT * gain.standard_error > GAIN_TOLERANCE * described
        )


def controller_check(recording: Recording, actuator: Actuator) -> ControllerCheck:
    """Return the error of the described controller for a recording, and the gains that fit it best.

        e = clip(G_prop (ε + ∫ε dt / T_i + T_d dε/dt) + k_ff θ̇_cmd / τ, ±ω_max) - β ω_f,   ε = θ_cmd - θ
        y = clip((GAP e + GAI ∫e dt) / k_t, ±y_max)

    from the recorded command, position and speed; θ_cmd and ω_f lag by the described time constants. y is the
    recorded current, or the duty cycle of a voltage drive (k_t = 1, y_max = 1). While the drive is off, y is
    0 and nothing is integrated. Both sides pass a low-pass with a cutoff from the position's noise, because
    the gains multiply that noise. The best-fitting gains come from a regression over rows without a limit and
    with the drive on, with all other parameters as described. Without speed feedback and feed-forward, only
    the product of G_prop and GAP is identifiable, and GAP keeps its described value. The described errors of
    the sensors are compensated.

    Raises
    ------
    RecordingError
        There is no command, no position, no current (no duty cycle of a voltage drive), or the drive is never
        on.
    """
    recording = as_by_ideal_sensors(recording, actuator)
    for name in ("command_rad", "position_rad"):
        if name not in recording:
            raise RecordingError(
                f"{recording.source}: no column '{name}', without which the controller cannot be checked"
            )
    c, interval = actuator.controller, recording.interval_s
    measured, unit, largest = _output(recording, actuator)
    on = recording["enabled"] > 0 if "enabled" in recording else np.ones(recording.samples, bool)
    if not on.any():
        raise RecordingError(
            f"{recording.source}: the drive is never on, so that nothing shows its controller"
        )
    cutoff = FilterFrequencies.of(recording["position_rad"], interval).regression_hz
    by_position, rate, by_speed = _loop_inputs(recording, actuator, on)
    limit = np.inf if c.speed_limit is None else c.speed_limit
    error = np.clip(c.position_gain * by_position + rate, -limit, limit) + by_speed
    output = (c.speed_gain * error + c.integral_gain * _integral(error, on, interval)) / unit
    predicted = np.where(on, np.clip(output, -largest, largest), 0.0)
    relative_error = _relative(
        low_pass(np.where(on, measured, 0.0), cutoff, interval), low_pass(predicted, cutoff, interval)
    )
    gains, best = _regression(recording, actuator, on, cutoff)
    described = (c.position_gain, c.speed_gain)
    if gains is None:
        return ControllerCheck(relative_error, None, None, None, described)
    noisier, _ = _regression(_with_more_noise(recording), actuator, on, cutoff)
    allowed = _with_allowance(allowing_for_noise, gains, noisier)
    if not {"speed_rad_s", "angle_rad"} & set(recording) and actuator.mechanics.backlash:
        crossing, _ = _regression(_with_gap(recording, actuator), actuator, on, cutoff)
        allowed = _with_allowance(_allowing_for_gap, allowed, crossing)
    return ControllerCheck(relative_error, best, *allowed, described)


def _with_gap(recording: Recording, actuator: Actuator) -> Recording:
    """Return the recording with the angle of a motor at the edge of the backlash in its last direction.

    The user's position does not show how the motor crosses the gap; here it crosses it instantly when the
    user reverses.
    """
    position, mechanics = recording["position_rad"], actuator.mechanics
    direction = np.sign(_rate(position, recording.interval_s))
    last = np.maximum.accumulate(np.where(direction != 0, np.arange(direction.size), 0))
    angle = position / mechanics.gear_ratio + direction[last] * mechanics.backlash / 2
    return recording.with_channels({**recording.channels, "angle_rad": angle})


def _with_more_noise(recording: Recording) -> Recording:
    """Return the recording with additional noise on its position, equal in rms to its noise or rounding."""
    position = recording["position_rad"]
    level = max(noise_level(position), rounding_step(position) / 12**0.5)
    noise = stream(0, "noise of a position once more").normal(0.0, level, position.size)
    return recording.with_channels({**recording.channels, "position_rad": position + noise})


def _with_allowance(allowing_for: _Allowance, gains: _Estimates, second: _Estimates | None) -> _Estimates:
    """Return the gains with standard errors that allow for their difference from `second` estimates."""
    position, speed = (None, None) if second is None else second
    return allowing_for(gains[0], position), allowing_for(gains[1], speed)


def _allowing_for_gap(
    gain: ParameterEstimate | None, crossing: ParameterEstimate | None
) -> ParameterEstimate | None:
    """Return a gain with a standard error that includes its difference from that of a `crossing` motor."""
    if gain is None:
        return None
    difference = math.inf if crossing is None else abs(crossing.value - gain.value)
    return replace(gain, standard_error=math.hypot(gain.standard_error, difference))


def allowing_for_noise(
    gain: ParameterEstimate | None, noisier: ParameterEstimate | None
) -> ParameterEstimate | None:
    """Return a gain with a standard error that includes its reduction by noise.

    The regression estimates a gain k as k / (1 + r), with the noise-to-signal ratio r of its regressor, and
    as k / (1 + 2 r) after the same noise is added again (simulation and extrapolation, Cook and Stefanski
    1994). Differences of a position in coarse counts may consist mostly of noise: a speed gain of 4.7e4 N·s/m
    was estimated as 0.9e4 ± 1.0e4.
    """
    if gain is None:
        return None
    inverse = 0.0 if noisier is None else 2 / gain.value - 1 / noisier.value
    reduction = abs(1 / inverse - gain.value) if inverse > 0 else math.inf
    return replace(gain, standard_error=math.hypot(gain.standard_error, reduction))


def _output(recording: Recording, actuator: Actuator) -> tuple[Array, float, float]:
    """Return the controller's output (n,), the torque per unit of it in the controller, and its limit."""
    if actuator.drive_kind != "voltage":
        current = with_equivalent_current(recording, actuator)["current_A"]
        return current, actuator.drive_constant, actuator.controller.current_limit
    if "duty" not in recording:
        raise RecordingError(
            f"{recording.source}: no column 'duty', without which a drive by voltage cannot be checked"
        )
    return recording["duty"], 1.0, 1.0


def _loop_inputs(
    recording: Recording, actuator: Actuator, on: NDArray[np.bool_]
) -> tuple[Array, Array, Array]:
    """Return the inputs of the speed loop, (n,) each, integrated only where the drive is `on`.

    They are the factor of the position gain [rad], the fed-forward speed demand [rad/s], and the negative
    speed feedback [rad/s].
    """
    c, interval = actuator.controller, recording.interval_s
    command = first_order_lag(recording["command_rad"], c.command_lag, interval)
    error = command - recording["position_rad"]
    by_position = (
        error
        + c.position_integral_gain * _integral(error, on, interval)
        + c.position_derivative_gain * _rate(error, interval)
    )
    forward = c.speed_feedforward * _rate(command, interval) / actuator.mechanics.gear_ratio
    speed = first_order_lag(_motor_speed(recording, actuator), c.speed_lag, interval)
    return by_position, forward, -c.speed_feedback * speed


def _integral(values: Array, on: NDArray[np.bool_], interval: float) -> Array:
    """Return the integral (n,) of `values` (n,) up to each row, from the last row with the drive not `on`."""
    summed = np.concatenate([[0.0], np.cumsum(values)])
    off = np.maximum.accumulate(np.where(on, 0, np.arange(1, values.size + 1)))
    return np.asarray(interval * (summed[1:] - summed[off]))


def _regression(
    recording: Recording, actuator: Actuator, on: NDArray[np.bool_], cutoff: float
) -> tuple[_Estimates | None, float | None]:
    """Return the gains that fit a recording best, and the relative error of the current with them.

    Both are None if the rows without a limit do not identify the gains, or if their sign is wrong.
    """
    c, interval = actuator.controller, recording.interval_s
    measured, unit, largest = _output(recording, actuator)
    by_position, rate, by_speed = _loop_inputs(recording, actuator, on)
    limit = np.inf if c.speed_limit is None else c.speed_limit
    demand = np.clip(c.position_gain * by_position + rate, -limit, limit)
    free = on & (np.abs(demand) < LIMITED * limit) & (np.abs(measured) < LIMITED * largest)
    columns = [by_position, by_speed + rate]
    if c.integral_gain:
        columns += [_integral(column, on, interval) for column in columns]

    def smooth(values: Array) -> Array:
        # Otherwise the low-pass would spread rows with a limit into rows without.
        return low_pass(np.where(free, values, 0.0), cutoff, interval)[free]

    regressors = np.stack([smooth(column) for column in columns if np.any(column)])
    torque = unit * smooth(measured)
    gain_unit = unit_for("N·m·s/rad", actuator.coordinates)
    fixed_gain = None if np.any(columns[1]) else c.speed_gain
    solution = _gains(regressors, torque, fixed_gain, gain_unit)
    return (None, None) if solution is None else (solution[1], _relative(torque, solution[0] @ regressors))


def _gains(
    regressors: Array, torque: Array, speed_gain: float | None, unit: str
) -> tuple[Array, _Estimates] | None:
    """Return coefficients and gains from `regressors` (p, rows) of a `torque` (rows,), None if unidentified.

    The torque is in N·m. A given `speed_gain` is fixed; `unit` is its unit.
    """
    if torque.size < LEAST_ROWS:
        return None
    size = np.sqrt(np.mean(regressors**2, axis=1))
    if not np.all(size > 0) or np.linalg.cond(regressors.T / size) > MOST_CONDITION:
        return None
    coefficients = np.asarray(np.linalg.lstsq(regressors.T, torque, rcond=None)[0], np.float64)
    scaled = (regressors / size[:, np.newaxis])[np.newaxis]
    residual = torque - coefficients @ regressors
    covariance = sandwich_covariance(scaled, residual, np.full(coefficients.size, np.inf)).covariance
    covariance = covariance / np.outer(size, size)
    derivative = np.zeros(coefficients.size)
    if speed_gain is not None:
        derivative[0] = 1 / speed_gain
        error = float(np.sqrt(derivative @ covariance @ derivative))
        return coefficients, (ParameterEstimate(float(coefficients[0] / speed_gain), error, "1/s"), None)
    if not (coefficients[0] > 0 and coefficients[1] > 0):
        return None
    ratio = coefficients[0] / coefficients[1]
    derivative[:2] = 1 / coefficients[1], -ratio / coefficients[1]
    error = float(np.sqrt(derivative @ covariance @ derivative))
    return coefficients, (
        ParameterEstimate(float(ratio), error, "1/s"),
        ParameterEstimate(float(coefficients[1]), float(np.sqrt(covariance[1, 1])), unit),
    )


def _rate(values: Array, interval: float) -> Array:
    """Return the time derivative of `values` (n,), by central differences."""
    return np.asarray(np.gradient(values, interval))


def _motor_speed(recording: Recording, actuator: Actuator) -> Array:
    """Return the motor's speed (n,) [rad/s]: recorded, or else by differences of its angle or position."""
    if "speed_rad_s" in recording:
        return recording["speed_rad_s"]
    if "angle_rad" in recording:
        return _rate(np.unwrap(recording["angle_rad"]), recording.interval_s)
    return _rate(recording["position_rad"], recording.interval_s) / actuator.mechanics.gear_ratio


def _relative(measured: Array, predicted: Array) -> float:
    """Return rms(measured - predicted) / rms(measured)."""
    return float(np.linalg.norm(measured - predicted) / np.linalg.norm(measured))
