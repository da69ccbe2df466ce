"""Arguments that are no recording, no actuator or no seed are refused in one line by all functions."""

from collections.abc import Callable
from typing import Any

import pytest

import emaphm as ema
from emaphm.errors import ActuatorError, RecordingError, SignalError

ACTUATOR = ema.Actuator.thesis()
NAME: Any = "thesis"
FILE: Any = "flight.csv"


@pytest.fixture(scope="module")
def recording() -> ema.Recording:
    return ema.simulate(ACTUATOR, ema.Chirp(), duration=0.05, model="averaged")


OF_RECORDING: dict[str, Callable[[Any, Any], Any]] = {
    "diagnose": ema.diagnose,
    "diagnose_joint": lambda recording, actuator: ema.diagnose_joint([recording, recording], actuator),
    "calibrate": lambda recording, actuator: ema.calibrate([recording], actuator, free=["inertia"]),
    "replay": ema.replay,
}


@pytest.mark.parametrize("name", OF_RECORDING)
def test_a_name_in_place_of_an_actuator_or_a_recording_is_refused(
    name: str, recording: ema.Recording
) -> None:
    with pytest.raises(ActuatorError, match=r"no actuator but a str; give what Actuator\.thesis"):
        OF_RECORDING[name](recording, NAME)
    with pytest.raises(RecordingError, match="no recording but a str; give what read_recording returns"):
        OF_RECORDING[name](FILE, ACTUATOR)


def test_simulating_and_reading_refuse_a_name_in_place_of_an_actuator_or_a_command() -> None:
    with pytest.raises(ActuatorError, match="no actuator but a str"):
        ema.simulate(NAME, ema.Chirp())
    with pytest.raises(ActuatorError, match="no actuator but a str"):
        ema.read_recording(FILE, NAME)
    command: Any = "chirp"
    with pytest.raises(SignalError, match=r"no command but a str; give one such as Chirp\(\)"):
        ema.simulate(ACTUATOR, command)


def test_the_settings_of_a_batch_refuse_a_negative_seed() -> None:
    with pytest.raises(SignalError, match="seed -1 is negative"):
        ema.DiagnosisSettings(seed=-1)
