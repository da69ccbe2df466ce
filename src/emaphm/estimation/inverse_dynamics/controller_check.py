"""Whether the controller that is described is the one that was at work in a recording."""

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
"""Relative deviation of a gain from its description that is no contradiction: a lag of half a millisecond
that the description leaves out moves the estimate by 4.5 % (`examples/emps`)."""

SIGNIFICANT = 3.0
"""Standard errors beyond the tolerance from which on a deviation counts."""

OTHER_LAW = 0.25
"""Relative error of the current with the best gains from which on the control law itself is another one."""

LEAST_ROWS = 20
"""Rows without a limit below which the gains are not estimated."""

MOST_CONDITION = 1e6
"""Condition number of the scaled regressors beyond which they act alike."""

LIMITED = 0.98
"""Share of a limit from which on a demand counts as limited: such rows do not show the gains."""


_Estimates: TypeAlias = tuple[ParameterEstimate | None, ParameterEstimate | None]
"""The position and the speed gain."""

_Allowance: TypeAlias = Callable[
    [ParameterEstimate | None, ParameterEstimate | None], ParameterEstimate | None
]
"""From a gain and what else was found of it to the gain with another error."""


@dataclass(frozen=True)
class ControllerCheck:
    """The described control law against a recording.

    `relative_error` is rms(recorded - predicted) / rms(recorded) of the current by the described gains,
    `best_error` by the `position_gain` and `speed_gain` that fit it best. These three are None where the
    recording does not show the gains, or shows ones of the wrong sign. `described` are the described gains,
    position first.

    The current is a small difference of two large terms, so that a gain 1 % off may make `relative_error`
    1: the contradiction is judged by the gains.
    """

    relative_error: float
    best_error: float | None
    position_gain: ParameterEstimate | None
    speed_gain: ParameterEstimate | None
    described: tuple[float, float]

    @property
    def contradicts(self) -> bool:
        """Whether the described gains, or the form of the control law, contradict the recording."""
        found = (self.position_gain, self.speed_gain)
        if not any(found):
            return self.relative_error > OTHER_LAW
        return bool(self.deviating) or (self.best_error or 0.0) > OTHER_LAW

    @property
    def gains_contradict(self) -> bool:
        """Whether other gains than those described explain the recording.

        Noise of the position lowers the gains of the regression (errors in variables); their standard errors
        allow for it.
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
            f"{name} {one.value:.4g} ± {one.standard_error:.1g} {one.unit}, described {described:.4g}"
            for name, one, described in gains
            if one is not None
            and abs(one.value - described) - SIGNIFICANT * one.standard_error > GAIN_TOLERANCE * described
        )


def controller_check(recording: Recording, actuator: Actuator) -> ControllerCheck:
    """Return how well the described controller explains a recording, and the gains that would.

        e = clip(G_prop (ε + ∫ε dt / T_i + T_d dε/dt) + k_ff θ̇_cmd / τ, ±ω_max) - β ω_f,   ε = θ_cmd - θ
        y = clip((GAP e + GAI ∫e dt) / k_t, ±y_max)

    from the recorded command, position and speed; θ_cmd and ω_f lag by the described time constants. y is the
    recorded current, or the duty cycle where the drive is driven by voltage (k_t = 1, y_max = 1). While the
    drive is off, y is 0 and nothing is integrated. Both sides pass the low-pass that the position's noise
    asks for, since the gains multiply that noise. The gains that fit best are those of a regression in rows
    without a limit and with the drive on, all but G_prop and GAP as described; without speed feedback and
    feed-forward only their product shows, and GAP is taken as described. The described errors of the sensors
    are undone.

    Raises
    ------
    RecordingError
        There is no command, no position, or neither a current nor, of a drive by voltage, a duty cycle; or
        the drive is never on.
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
    gains, best = _regressed(recording, actuator, on, cutoff)
    described = (c.position_gain, c.speed_gain)
    if gains is None:
        return ControllerCheck(relative_error, None, None, None, described)
    noisier, _ = _regressed(_noisier(recording), actuator, on, cutoff)
    found = _both(allowing_for_noise, gains, noisier)
    if not {"speed_rad_s", "angle_rad"} & set(recording) and actuator.mechanics.backlash:
        crossing, _ = _regressed(_with_gap(recording, actuator), actuator, on, cutoff)
        found = _both(_allowing_for_gap, found, crossing)
    return ControllerCheck(relative_error, best, *found, described)


def _with_gap(recording: Recording, actuator: Actuator) -> Recording:
    """Return the recording with the motor's angle as it would be at the edge of the backlash it last went to.

    The user's position does not show how the motor crosses the gap, here at once as the user turns.
    """
    position, mechanics = recording["position_rad"], actuator.mechanics
    way = np.sign(_rate(position, recording.interval_s))
    last = np.maximum.accumulate(np.where(way != 0, np.arange(way.size), 0))
    angle = position / mechanics.gear_ratio + way[last] * mechanics.backlash / 2
    return recording.with_channels({**recording.channels, "angle_rad": angle})


def _noisier(recording: Recording) -> Recording:
    """Return the recording with as much noise on its position once more as it has, or its rounding makes."""
    position = recording["position_rad"]
    level = max(noise_level(position), rounding_step(position) / 12**0.5)
    noise = stream(0, "noise of a position once more").normal(0.0, level, position.size)
    return recording.with_channels({**recording.channels, "position_rad": position + noise})


def _both(allowing_for: _Allowance, gains: _Estimates, others: _Estimates | None) -> _Estimates:
    """Return the gains with errors that allow for what makes the `others` of them."""
    position, speed = (None, None) if others is None else others
    return allowing_for(gains[0], position), allowing_for(gains[1], speed)


def _allowing_for_gap(
    one: ParameterEstimate | None, crossing: ParameterEstimate | None
) -> ParameterEstimate | None:
    """Return a gain, its error with how far it is from that of a motor `crossing` the backlash."""
    if one is None:
        return None
    apart = math.inf if crossing is None else abs(crossing.value - one.value)
    return replace(one, standard_error=math.hypot(one.standard_error, apart))


def allowing_for_noise(
    one: ParameterEstimate | None, noisier: ParameterEstimate | None
) -> ParameterEstimate | None:
    """Return a gain, its error with how much the noise lowers it.

    A gain k is found as k / (1 + r), r the noise of its regressor relative to its signal, and as
    k / (1 + 2 r) where there is as much noise once more (simulation and extrapolation, Cook and Stefanski
    1994). Differences of a position in coarse counts may be noise for the most part: a speed gain of
    4.7e4 N·s/m was found as 0.9e4 ± 1.0e4.
    """
    if one is None:
        return None
    inverse = 0.0 if noisier is None else 2 / one.value - 1 / noisier.value
    lowered = abs(1 / inverse - one.value) if inverse > 0 else math.inf
    return replace(one, standard_error=math.hypot(one.standard_error, lowered))


def _output(recording: Recording, actuator: Actuator) -> tuple[Array, float, float]:
    """Return what the controller asked for (n,), the torque for 1 of it as it assumes, and its limit."""
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
    """Return what enters the loop, (n,) each, by the rows in which the drive is `on`.

    What the position gain multiplies [rad], the speed demand that is fed forward, and the speed that is fed
    back with its sign turned [rad/s].
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
    """Return the integral of `values` (n,) up to each row, from 0 where the drive was last not `on`, (n,)."""
    summed = np.concatenate([[0.0], np.cumsum(values)])
    off = np.maximum.accumulate(np.where(on, 0, np.arange(1, values.size + 1)))
    return np.asarray(interval * (summed[1:] - summed[off]))


def _regressed(
    recording: Recording, actuator: Actuator, on: NDArray[np.bool_], cutoff: float
) -> tuple[_Estimates | None, float | None]:
    """Return the gains that fit a recording best, and the relative error of the current with them.

    None where the rows without a limit do not show them, or show ones of the wrong sign.
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
        # The low-pass would carry rows with a limit into those without.
        return low_pass(np.where(free, values, 0.0), cutoff, interval)[free]

    regressors = np.stack([smooth(column) for column in columns if np.any(column)])
    torque = unit * smooth(measured)
    gain_unit = unit_for("N·m·s/rad", actuator.coordinates)
    held = None if np.any(columns[1]) else c.speed_gain
    found = _gains(regressors, torque, held, gain_unit)
    return (None, None) if found is None else (found[1], _relative(torque, found[0] @ regressors))


def _gains(
    regressors: Array, torque: Array, speed_gain: float | None, unit: str
) -> tuple[Array, _Estimates] | None:
    """Return coefficients and gains for `regressors` (p, rows) of a `torque` (rows,), None where hidden.

    The torque is in N·m. A `speed_gain` that is given is held; `unit` is its unit.
    """
    if torque.size < LEAST_ROWS:
        return None
    size = np.sqrt(np.mean(regressors**2, axis=1))
    if not np.all(size > 0) or np.linalg.cond(regressors.T / size) > MOST_CONDITION:
        return None
    product = np.asarray(np.linalg.lstsq(regressors.T, torque, rcond=None)[0], np.float64)
    scaled = (regressors / size[:, np.newaxis])[np.newaxis]
    residual = torque - product @ regressors
    covariance = sandwich_covariance(scaled, residual, np.full(product.size, np.inf)).covariance
    covariance = covariance / np.outer(size, size)
    along = np.zeros(product.size)
    if speed_gain is not None:
        along[0] = 1 / speed_gain
        error = float(np.sqrt(along @ covariance @ along))
        return product, (ParameterEstimate(float(product[0] / speed_gain), error, "1/s"), None)
    if not (product[0] > 0 and product[1] > 0):
        return None
    ratio = product[0] / product[1]
    along[:2] = 1 / product[1], -ratio / product[1]
    error = float(np.sqrt(along @ covariance @ along))
    return product, (
        ParameterEstimate(float(ratio), error, "1/s"),
        ParameterEstimate(float(product[1]), float(np.sqrt(covariance[1, 1])), unit),
    )


def _rate(values: Array, interval: float) -> Array:
    return np.asarray(np.gradient(values, interval))


def _motor_speed(recording: Recording, actuator: Actuator) -> Array:
    """Return the motor's speed (n,) [rad/s]: as recorded, else by differences of its angle or position."""
    if "speed_rad_s" in recording:
        return recording["speed_rad_s"]
    if "angle_rad" in recording:
        return _rate(np.unwrap(recording["angle_rad"]), recording.interval_s)
    return _rate(recording["position_rad"], recording.interval_s) / actuator.mechanics.gear_ratio


def _relative(measured: Array, predicted: Array) -> float:
    return float(np.linalg.norm(measured - predicted) / np.linalg.norm(measured))
