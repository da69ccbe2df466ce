"""A command that the drive holds from each row to the next one."""

from pathlib import Path

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp
from emaphm.actuator.channels import CommandHeld, Sampling
from emaphm.arrays import rms
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.replay import replay
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

GAIN, SUPPLY, RESISTANCE, CONSTANT, INERTIA, VISCOUS = 2.0, 10.0, 4.0, 0.5, 5e-3, 1e-2

SERVO = f"""
name = "servo"
[controller]
position_gain = {GAIN}
speed_gain = 1.0
speed_feedback = 0.0
current_limit = 20.0
[motor]
torque_constant = {CONSTANT}
[electrical]
supply = {SUPPLY}
resistance = {RESISTANCE}
inductance = 1e-5
[drive]
kind = "voltage"
[mechanics]
inertia_motor = {INERTIA}
viscous_motor = {VISCOUS}
static_friction_motor = 0.0
dynamic_friction_motor = 0.0
gear_ratio = 1.0
[channels]
sampling = "instant"
"""


def holding(actuator: Actuator, sent: CommandHeld) -> Actuator:
    channels = actuator.channels.model_copy(update={"command_held": sent, "sampling": "instant"})
    return actuator.model_copy(update={"channels": channels})


def servo_recording(
    sent: CommandHeld, interval: float = 0.02, rows: int = 60, steps: int = 1000
) -> Recording:
    """Integrate θ̈ = (k i - B ω) / J, i = (D V - k ω) / R, D = g (goal - θ), by `steps` steps per row."""
    goal = 0.3 * np.sin(2 * np.pi * 2.0 * interval * np.arange(rows))
    step, angle, speed, read, held = interval / steps, 0.0, 0.0, [], 0.0

    def current() -> float:
        return (GAIN * (held - angle) * SUPPLY - CONSTANT * speed) / RESISTANCE

    for command in goal.tolist():
        if sent == "before":
            held = command
        read.append((angle, current()))
        held = command
        for _ in range(steps):
            speed += step * (CONSTANT * current() - VISCOUS * speed) / INERTIA
            angle += step * speed
    position, amperes = np.array(read).T
    channels = {"time_s": interval * np.arange(rows), "command_rad": goal}
    channels |= {"position_rad": position, "current_A": amperes}
    return Recording(channels, "instant", "integrated")


@pytest.mark.parametrize(("sent", "other"), [("before", "after"), ("after", "before")])
def test_a_held_command_explains_a_servo_that_receives_it_row_by_row(
    tmp_path: Path, sent: CommandHeld, other: CommandHeld
) -> None:
    (tmp_path / "servo.toml").write_text(SERVO, encoding="utf-8")
    described = Actuator.from_toml(tmp_path / "servo.toml")
    recording = servo_recording(sent)

    def relative_errors(actuator: Actuator) -> dict[str, float]:
        errors = replay(recording, actuator).rms_error
        return {name: errors[name] / rms(recording[name]) for name in ("position_rad", "current_A")}

    right = relative_errors(holding(described, sent))
    assert right["position_rad"] < 2e-3
    assert right["current_A"] < 2e-2
    # Half a row of delay, 10 ms at 2 Hz, is 13 % of a sine.
    assert relative_errors(described)["position_rad"] > 0.1
    assert relative_errors(holding(described, other))["current_A"] > 0.1


def test_a_held_command_has_the_value_of_the_last_row_sent() -> None:
    times = np.arange(60) * 5e-3
    channels = {"time_s": times, "command_rad": np.sin(30 * times), "position_rad": np.sin(30 * times)}
    recording = Recording(channels, "instant", "made")
    rows = recording["command_rad"]
    within = (times[1:-1, np.newaxis] + np.array([1e-6, 2.5e-3, 4.999e-3])).ravel()
    for sent, at_rows in (("before", rows[1:-1]), ("after", rows[:-2])):
        driving = DrivingSignals.of(recording, holding(THESIS, sent))  # type: ignore[arg-type]
        np.testing.assert_array_equal(
            driving.command(np.asarray(within, np.float64)), np.repeat(rows[1:-1], 3)
        )
        np.testing.assert_array_equal(driving.command(np.asarray(times[1:-1], float)), at_rows)
        assert driving.other_command is None


@pytest.mark.parametrize("sampling", ["mean", "instant"])
@pytest.mark.parametrize("sent", ["before", "after"])
def test_a_simulated_drive_that_holds_the_command_is_replayed(sampling: Sampling, sent: CommandHeld) -> None:
    chirp = Chirp(amplitude=5e-3, stop_hz=10, duration=0.3)
    actuator = holding(THESIS, sent)
    recording = simulate(
        actuator, chirp, model="averaged", duration=0.3, sample_rate=500.0, sampling=sampling
    )
    np.testing.assert_array_equal(recording["command_rad"], chirp(recording["time_s"].astype(np.float64)))
    for name, error in replay(recording, actuator).rms_error.items():
        # A start from means of rows is less exact.
        assert error < (1e-6 if sampling == "instant" else 1e-2) * rms(recording[name]), name
