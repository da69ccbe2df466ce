"""Whether the controller that is described is the one that was at work in a recording."""

from dataclasses import dataclass

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.errors import RecordingError
from emaphm.estimation.inverse_dynamics.filtering import FilterFrequencies, first_order_lag, low_pass
from emaphm.estimation.inverse_dynamics.result import Estimate
from emaphm.estimation.uncertainty.covariance import sandwich_covariance
from emaphm.recording import Recording, with_equivalent_current

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
    position_gain: Estimate | None
    speed_gain: Estimate | None
    described: tuple[float, float]

    @property
    def contradicts(self) -> bool:
        """Whether the described gains, or the form of the control law, contradict the recording."""
        if self.position_gain is None or self.speed_gain is None:
            return self.relative_error > OTHER_LAW
        deviations = (
            (abs(found.value - described) - SIGNIFICANT * found.standard_error) / described
            for found, described in zip((self.position_gain, self.speed_gain), self.described, strict=True)
        )
        return max(deviations) > GAIN_TOLERANCE or (self.best_error or 0.0) > OTHER_LAW


def controller_check(recording: Recording, actuator: Actuator) -> ControllerCheck:
    """Return how well the described controller explains a recording's current, and the gains that would.

        τ_d = GAP (v_d - ω_f) + GAI ∫(v_d - ω_f) dt,   v_d = clip(G_prop (θ_cmd - θ), ±ω_max)
        i_d = clip(τ_d / k_t, ±I_max)

    from the recorded command, position and speed; ω_f lags by the described time constant. Both currents
    pass the low-pass that the position's noise asks for, since the gains multiply that noise. The gains that
    fit best are those of a regression of the current's torque on the position error, the speed and, where the
    description has an integral gain, their integrals, in rows without a limit.

    Raises
    ------
    RecordingError
        There is no command, position or current.
    """
    for name in ("command_rad", "position_rad"):
        if name not in recording:
            raise RecordingError(
                f"{recording.source}: no column '{name}', without which the controller cannot be checked"
            )
    current = with_equivalent_current(recording, actuator)["current_A"]
    c, interval = actuator.controller, recording.interval_s
    error = recording["command_rad"] - recording["position_rad"]
    speed = first_order_lag(_motor_speed(recording, actuator), c.speed_lag, interval)
    limit = np.inf if c.speed_limit is None else c.speed_limit
    demand = np.clip(c.position_gain * error, -limit, limit)
    torque = c.speed_gain * (demand - speed)
    if c.integral_gain:
        torque = torque + c.integral_gain * interval * np.cumsum(demand - speed)
    predicted = np.clip(torque / c.torque_constant, -c.current_limit, c.current_limit)
    cutoff = FilterFrequencies.of(recording["position_rad"], interval).regression_hz

    def smooth(values: Array) -> Array:
        return low_pass(values, cutoff, interval)

    target = smooth(current)
    relative_error = _relative(target, smooth(predicted))
    free = (np.abs(demand) < LIMITED * limit) & (np.abs(current) < LIMITED * c.current_limit)
    columns = [error, -speed]
    if c.integral_gain:
        columns += [interval * np.cumsum(error), -interval * np.cumsum(speed)]
    regressors = np.stack([smooth(one)[free] for one in columns])
    gains = _regressed(regressors, c.torque_constant * target[free])
    described = (c.position_gain, c.speed_gain)
    if gains is None:
        return ControllerCheck(relative_error, None, None, None, described)
    best = _relative(c.torque_constant * target[free], gains.product @ regressors)
    return ControllerCheck(relative_error, best, *gains.estimates, described)


def controller_contradicts(recording: Recording, actuator: Actuator) -> bool:
    """Return whether the described gains contradict the recording, by `controller_check`."""
    return controller_check(recording, actuator).contradicts


@dataclass(frozen=True, eq=False)
class _Gains:
    """The regression's coefficients, and the position and speed gain that they amount to."""

    product: Array
    estimates: tuple[Estimate, Estimate]


def _regressed(regressors: Array, torque: Array) -> _Gains | None:
    """Return the gains for `regressors` (p, rows) of a `torque` (rows,) [N·m], None where hidden."""
    size = np.sqrt(np.mean(regressors**2, axis=1)) if torque.size > LEAST_ROWS else np.zeros(1)
    if not np.all(size > 0) or np.linalg.cond(regressors.T / size) > MOST_CONDITION:
        return None
    product = np.asarray(np.linalg.lstsq(regressors.T, torque, rcond=None)[0], np.float64)
    if not (product[0] > 0 and product[1] > 0):
        return None
    covariance = sandwich_covariance(
        regressors[np.newaxis], torque - product @ regressors, np.full(product.size, np.inf)
    ).covariance
    ratio = product[0] / product[1]
    along = np.zeros(product.size)
    along[:2] = 1 / product[1], -ratio / product[1]
    return _Gains(
        product,
        (
            Estimate(float(ratio), float(np.sqrt(along @ covariance @ along)), "1/s"),
            Estimate(float(product[1]), float(np.sqrt(covariance[1, 1])), "N·m·s/rad"),
        ),
    )


def _motor_speed(recording: Recording, actuator: Actuator) -> Array:
    """Return the motor's speed (n,) [rad/s]: as recorded, else by differences of its angle or position."""
    if "speed_rad_s" in recording:
        return recording["speed_rad_s"]
    if "angle_rad" in recording:
        return np.gradient(np.unwrap(recording["angle_rad"]), recording.interval_s)
    return np.gradient(recording["position_rad"], recording.interval_s) / actuator.mechanics.gear_ratio


def _relative(measured: Array, predicted: Array) -> float:
    return float(np.linalg.norm(measured - predicted) / np.linalg.norm(measured))
