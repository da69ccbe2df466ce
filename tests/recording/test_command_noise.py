"""Noise that a recorder adds to the command is smoothed; noise that the drive received is kept."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Step
from emaphm.arrays import Array
from emaphm.recording import Recording
from emaphm.recording.sensor_checks import check_sensors
from emaphm.recording.sensor_checks.command_noise import smoothed, smoothed_command
from emaphm.simulated_recording import simulate

ROWS = 2500
NAMES = ("time_s", "command_rad", "current_A")


def noise(deviation: float) -> Array:
    return np.random.default_rng(3).normal(0.0, deviation, ROWS)


def recorded(recording: Recording, command: Array) -> Recording:
    return Recording({**{name: recording[name] for name in NAMES}, "command_rad": command})


@pytest.fixture(scope="module")
def clean() -> Recording:
    return simulate(THESIS, Chirp(), noise=0.05)


@pytest.mark.parametrize("deviation", [3e-6, 1e-5, 5e-5])
def test_noise_of_the_recorder_is_smoothed(clean: Recording, deviation: float) -> None:
    spoilt = recorded(clean, clean["command_rad"] + noise(deviation))
    checked = check_sensors(spoilt, THESIS)
    (finding,) = checked.findings
    assert (finding.channel, finding.kind) == ("command_rad", "noise")
    assert finding.size == pytest.approx(deviation, rel=0.1)
    # An ideal low-pass at 100 Hz, far above the chirp's 15 Hz, would leave a fifth of the noise.
    error = checked.recording["command_rad"] - clean["command_rad"]
    assert np.sqrt(np.mean(error**2)) < deviation / 3


@pytest.mark.parametrize("late", [-3, 0, 3])
def test_noise_that_the_drive_received_is_kept(late: int) -> None:
    chirp, received, rate = Chirp(), noise(1e-5), 5000.0

    def command(t: Array) -> Array:
        rows = np.minimum((t * rate + 1e-6).astype(int), ROWS - 1)
        return np.asarray(chirp(t) + received[rows])

    recording = simulate(THESIS, command, noise=0.05)
    shifted = Recording({**dict(recording.channels), "current_A": np.roll(recording["current_A"], late)})
    assert smoothed_command(shifted, THESIS) is None


@pytest.mark.parametrize("actuator", [Actuator.six_step(), Actuator.pmsm()])
def test_noise_is_kept_where_the_current_control_is_slow(actuator: Actuator, clean: Recording) -> None:
    spoilt = recorded(clean, clean["command_rad"] + noise(5e-5))
    assert smoothed_command(spoilt, actuator) is None


def test_a_command_without_noise_is_kept(clean: Recording) -> None:
    assert smoothed_command(clean, THESIS) is None
    assert smoothed_command(recorded(clean, clean["command_rad"] + noise(1e-7)), THESIS) is None


def test_jumps_of_the_command_are_kept() -> None:
    step = simulate(THESIS, Step(start=0.1003), noise=0.05)
    spoilt = recorded(step, step["command_rad"] + noise(1e-5))
    values, _ = smoothed_command(spoilt, THESIS) or pytest.fail("not smoothed")
    assert np.abs(values - step["command_rad"]).max() < 5e-5


def test_a_command_behind_a_described_lag_is_kept(clean: Recording) -> None:
    spoilt = recorded(clean, clean["command_rad"] + noise(1e-5))
    controller = THESIS.controller.model_copy(update={"command_lag": 0.01})
    assert smoothed_command(spoilt, THESIS.model_copy(update={"controller": controller})) is None


def test_the_smoother_keeps_a_parabola() -> None:
    # Third differences of a parabola are 0: the smoother returns it whatever its weight.
    rows = np.arange(200.0)
    parabola = 2.0 - 0.3 * rows + 0.01 * rows**2
    np.testing.assert_allclose(smoothed(parabola), parabola, atol=1e-7)
