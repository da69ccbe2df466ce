"""A wrong unit of time is found in slow and fast rows; true slow and fast rows are accepted."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Command, Faults, Sine, Step
from emaphm.errors import RecordingError
from emaphm.recording import Recording, check_plausible
from emaphm.simulated_recording import simulate

FAULTS = (Faults(), Faults(0.5, 0.9, 0.1, 0.6, 0.2, 0.4, 0.8, 0.4))
KEPT = ("time_s", "command_rad", "current_A")


def recorded(command: Command, rate: float, duration: float, faults: Faults, *more: str) -> Recording:
    def load(t: np.ndarray) -> np.ndarray:
        return np.asarray(0.1 * np.sin(0.4 * t))

    recording = simulate(
        THESIS,
        command,
        model="averaged",
        faults=faults,
        duration=duration,
        sample_rate=rate,
        load=load,
        noise=0.05,
    )
    return Recording({name: recording[name] for name in (*KEPT, *more)})


@pytest.mark.parametrize("faults", FAULTS)
def test_a_fast_logger_in_milliseconds_is_found_by_the_torque(faults: Faults) -> None:
    fast = recorded(Chirp(), 20e3, 0.5, faults)
    check_plausible(fast, THESIS)
    with pytest.raises(RecordingError, match="times the described inertia: time_s seems to be in millisec"):
        check_plausible(fast.with_channels({**fast.channels, "time_s": 1e3 * fast["time_s"]}), THESIS)


def test_a_fast_logger_in_milliseconds_is_found_by_the_speed() -> None:
    fast = recorded(Sine(), 20e3, 0.5, Faults(), "speed_rad_s")
    with pytest.raises(
        RecordingError, match=r"the motor's speed is .* times that of its motion: time_s seems"
    ):
        check_plausible(fast.with_channels({**fast.channels, "time_s": 1e3 * fast["time_s"]}), THESIS)


@pytest.mark.parametrize("faults", FAULTS)
@pytest.mark.parametrize("rate", [10.0, 40.0])
@pytest.mark.parametrize("rows_a_cycle", [5.0, 100.0])
def test_slow_rows_in_seconds_are_accepted(faults: Faults, rate: float, rows_a_cycle: float) -> None:
    fastest = rate / rows_a_cycle
    for command in (Chirp(stop_hz=fastest, duration=20.0), Sine(frequency_hz=fastest)):
        check_plausible(recorded(command, rate, 20.0, faults, "position_rad", "speed_rad_s"), THESIS)


@pytest.mark.parametrize("faults", FAULTS)
@pytest.mark.parametrize("rate", [200.0, 1e3, 5e3])
def test_seconds_taken_for_milliseconds_are_found_by_the_work(faults: Faults, rate: float) -> None:
    sound = recorded(Chirp(), rate, 0.5, faults, "position_rad")
    check_plausible(sound, THESIS)
    fast = sound.with_channels({**sound.channels, "time_s": 1e-3 * sound["time_s"]})
    with pytest.raises(
        RecordingError, match=r"work that the motor can do: .* larger unit .*; convert it to s"
    ):
        check_plausible(fast, THESIS)
    declared = Actuator.from_dict(
        THESIS.model_dump() | {"channels": {"time_s": {"column": "t", "unit": "ms"}}}
    )
    with pytest.raises(RecordingError, match=r"\[channels\] says 'ms', correct it there"):
        check_plausible(fast, declared)


@pytest.mark.parametrize("faults", FAULTS)
@pytest.mark.parametrize(("rate", "duration"), [(50e3, 0.3), (100e3, 0.05), (1e6, 0.01)])
@pytest.mark.parametrize("command", [Chirp(), Step(0.05), Sine(1e-5)])
def test_fast_rows_in_seconds_are_accepted(
    faults: Faults, rate: float, duration: float, command: Command
) -> None:
    sound = recorded(command, rate, duration, faults, "position_rad")
    rng = np.random.default_rng(0)
    # An encoder of 1e-3 rad, and white noise of 1e-4 rad.
    for position in (
        1e-3 * np.round(sound["position_rad"] / 1e-3),
        sound["position_rad"] + 1e-4 * rng.standard_normal(sound.samples),
    ):
        check_plausible(sound.with_channels({**sound.channels, "position_rad": position}), THESIS)
