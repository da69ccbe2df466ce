"""The unit of a motor angle, wrapped or not, is found by comparison with the motion in another channel."""

import numpy as np
import pytest

from cases import THESIS, drawn
from emaphm.actuator import Actuator, Chirp, Faults, Step
from emaphm.recording import Recording
from emaphm.recording.angle_unit import angle_unit_complaint
from emaphm.simulated_recording import simulate

PAIRS = THESIS.electrical.pole_pairs if THESIS.electrical else 0
UNITS = {
    "in degrees": (180 / np.pi, 360.0),
    "in revolutions": (1 / (2 * np.pi), 1.0),
    "in milliradians": (1e3, 2e3 * np.pi),
    "the electrical angle:": (PAIRS, 2 * np.pi),
    "the electrical angle in degrees": (PAIRS * 180 / np.pi, 360.0),
}
WHOLE = simulate(THESIS, Chirp(), faults=Faults(friction=0.2), duration=0.3, noise=0.05, adc_bits=12, seed=41)


def complaint(recording: Recording, size: float, turn: float | None, channel: str | None) -> str | None:
    columns = {
        name: recording[name]
        for name in ("time_s", "command_rad", "current_A", *([channel] if channel else []))
    }
    angle = size * recording["angle_rad"]
    columns["angle_rad"] = angle if turn is None else np.mod(angle, turn)
    return angle_unit_complaint(Recording(columns), THESIS)


@pytest.mark.parametrize("channel", ["speed_rad_s", "position_rad", None])
@pytest.mark.parametrize("unit", UNITS)
def test_a_wrong_angle_unit_is_named(unit: str, channel: str | None) -> None:
    size, turn = UNITS[unit]
    for wrapped in (None, turn):
        message = complaint(WHOLE, size, wrapped, channel)
        assert message is not None
        assert f"it seems to be {unit}" in message
        assert f"by {channel or 'command_rad'};" in message


@pytest.mark.parametrize("channel", ["speed_rad_s", "position_rad", None])
@pytest.mark.parametrize("command", [Chirp(), Step()])
def test_angles_of_faulty_actuators_raise_no_unit_complaint(
    command: Chirp | Step, channel: str | None
) -> None:
    for vector in drawn(4, seed=43):
        recording = simulate(
            THESIS, command, faults=Faults.from_vector(vector), model="averaged", duration=0.3
        )
        for wrapped in (None, 2 * np.pi):
            assert complaint(recording, 1.0, wrapped, channel) is None


def test_a_resting_motor_raises_no_unit_complaint() -> None:
    still = Recording({**WHOLE.channels, "angle_rad": np.full(WHOLE.samples, 0.3)})
    assert angle_unit_complaint(still, Actuator.thesis()) is None
