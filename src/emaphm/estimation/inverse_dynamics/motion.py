"""Measured motion of a recording for inverse dynamics, and the channel that it is compared with."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.errors import MethodError, RecordingError, nearest
from emaphm.estimation.inverse_dynamics.filtering import FilterFrequencies, first_order_lag, low_pass
from emaphm.estimation.sensors.ideal_sensors import as_by_ideal_sensors
from emaphm.recording import Recording, with_equivalent_current
from emaphm.simulation.laws.saturation import flux_left

STILL_SPEED = 0.01
"""Speed below which a shaft counts as standing, relative to the rms speed, if the noise is lower."""

STILL_NOISE = 3.0
"""Speed below which a shaft counts as standing, relative to the rms of the speed's noise."""

RESPONSES = ("current_A", "voltage_V", "duty")
"""Channels that inverse dynamics explains, in order of preference: the current determines the torque."""


@dataclass(frozen=True, eq=False)
class Motion:
    """The measured motion of one recording, all columns of shape (n,).

    `position` [rad] is that of the user; `angle` [rad], `speed` [rad/s] and `acceleration` [rad/s²] are those
    of the motor, after the low-pass of `frequencies`. `load` [N·m] is the recorded load, 0 if not recorded.
    `response` is the channel `channel`: a voltage [V], or a current [A] reduced by saturation and delayed by
    the torque's lag, so that it is proportional to the torque. `still_speed` [rad/s] is the speed below which
    the shaft counts as standing; `moving` states whether it was faster while the drive was on.
    """

    source: str
    interval: float
    time: Array
    position: Array
    angle: Array
    speed: Array
    acceleration: Array
    load: Array
    channel: str
    response: Array
    frequencies: FilterFrequencies
    still_speed: float
    moving: NDArray[np.bool_]

    @classmethod
    def of(
        cls,
        recording: Recording,
        actuator: Actuator,
        *,
        position_hz: float | None = None,
        regression_hz: float | None = None,
        channel: str | None = None,
    ) -> Self:
        """Return the motion of a `recording`.

        Speed and acceleration are central differences of the motor's angle, or of the user's position divided
        by the gear ratio if the angle was not recorded; a recorded speed is not used, because it often has a
        lag of its own. The described errors of the sensors are compensated. A current is reduced by
        saturation and passes the lag of the torque.

        Raises
        ------
        RecordingError
            There is neither a position nor an angle, neither a current nor a voltage, or no motion.
        """
        recording = as_by_ideal_sensors(recording, actuator)
        interval = recording.interval_s
        angle, position = _angle_and_position(recording, actuator.mechanics.gear_ratio)
        frequencies = FilterFrequencies.of(
            angle, interval, position_hz=position_hz, regression_hz=regression_hz
        )
        smooth = low_pass(angle, frequencies.position_hz, interval)
        speed = np.gradient(smooth, interval)
        rms = float(np.sqrt(np.mean(speed**2)))
        still_speed = max(STILL_SPEED * rms, STILL_NOISE * frequencies.speed_noise)
        moving = np.abs(speed) > still_speed
        if "enabled" in recording:
            moving &= recording["enabled"] > 0
        if not moving.any():
            raise RecordingError(
                f"{recording.source}: the shaft never moves faster than {still_speed:.3g}, the noise limit; "
                "record a manoeuvre with more motion"
            )
        channel = channel or _best_channel(recording, actuator)
        return cls(
            source=recording.source,
            interval=interval,
            time=recording["time_s"],
            position=low_pass(position, frequencies.position_hz, interval),
            angle=smooth,
            speed=speed,
            acceleration=np.gradient(speed, interval),
            load=recording["load_Nm"] if "load_Nm" in recording else np.zeros(recording.samples),
            channel=channel,
            response=_response(recording, actuator, channel),
            frequencies=frequencies,
            still_speed=still_speed,
            moving=moving,
        )


def _angle_and_position(recording: Recording, gear_ratio: float) -> tuple[Array, Array]:
    """Return the motor's angle and the user's position [rad], (n,) each: one by the other if not recorded."""
    if "angle_rad" in recording:
        angle = np.unwrap(recording["angle_rad"])
        return angle, recording["position_rad"] if "position_rad" in recording else angle * gear_ratio
    if "position_rad" in recording:
        position = recording["position_rad"]
        return position / gear_ratio, position
    raise RecordingError(
        f"{recording.source}: inverse dynamics needs the measured motion; record 'position_rad' or "
        "'angle_rad', or simulate from the command"
    )


def _best_channel(recording: Recording, actuator: Actuator) -> str:
    """Return the name of the preferred channel for the torque."""
    if "current_A" in recording or ("angle_rad" in recording and "current_a_A" in recording):
        return "current_A"
    for name in RESPONSES[1:]:
        if name in recording and actuator.electrical is not None:
            return name
    raise RecordingError(
        f"{recording.source}: nothing shows the torque; record 'current_A' with its sign, or 'voltage_V' or "
        "'duty' with [electrical] in the actuator's TOML"
    )


def _response(recording: Recording, actuator: Actuator, channel: str) -> Array:
    """Return the `channel` of a recording, (n,): a voltage [V], or a current [A] that gives the torque."""
    if channel not in RESPONSES:
        raise MethodError(f"'{channel}' does not show the torque{nearest(channel, RESPONSES)}")
    if channel == "current_A":
        current = with_equivalent_current(recording, actuator)["current_A"]
        effective = flux_left(actuator.motor.saturation or 0.0, current) * current
        return first_order_lag(effective, actuator.motor.torque_lag, recording.interval_s)
    if actuator.electrical is None:
        raise MethodError(
            "the torque follows from a voltage only if the resistance is known; add [electrical] to "
            f"'{actuator.name}'"
        )
    if channel == "voltage_V":
        return recording["voltage_V"]
    supply = recording.channels.get("supply_V", actuator.electrical.supply)
    return np.asarray(recording["duty"] * supply)
