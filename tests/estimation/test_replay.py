"""A replay holds the model against every channel of a recording, each by its relative error."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from cases import INTERVAL, THESIS
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.lumped_parameters import with_totals
from emaphm.arrays import Array
from emaphm.errors import MethodError, RecordingError
from emaphm.estimation import replay
from emaphm.estimation.replay import relative_error
from emaphm.recording import Recording
from emaphm.recording.schema import SCHEMA
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED

FREQUENCY = 2 * np.pi * 15
"""The chirp's highest [rad/s]."""


def test_the_relative_error_by_hand() -> None:
    # Differences 1, 0, 2, 2: rms 1.5. Measured 3, 3, 5, 1: rms sqrt(11).
    measured, modelled = np.array([3.0, 3.0, 5.0, 1.0]), np.array([2.0, 3.0, 3.0, -1.0])
    assert relative_error("current_A", measured, modelled) == pytest.approx(1.5 / np.sqrt(11))
    assert relative_error("current_A", measured, measured) == 0


@given(
    angle=arrays(np.float64, 10, elements=st.floats(1, 9)),
    turns=arrays(np.int64, 10, elements=st.integers(-3, 3)),
)
def test_angles_are_compared_modulo_a_turn(angle: Array, turns: NDArray[np.int64]) -> None:
    assert relative_error("angle_rad", angle, angle + 2 * np.pi * turns) == pytest.approx(0, abs=1e-14)
    off = relative_error("angle_rad", angle, angle + 2 * np.pi * turns + 0.1)
    assert off == pytest.approx(0.1 / np.sqrt(np.mean(angle**2)))


def test_every_shared_channel_of_the_schema_is_judged(healthy: Recording) -> None:
    found = replay(healthy, THESIS)
    assert set(found.relative_error) == {
        "position_rad",
        "speed_rad_s",
        "angle_rad",
        "current_A",
        "voltage_V",
    }
    for name, error in found.relative_error.items():
        by_hand = np.sqrt(np.mean((healthy[name] - found.signals[name]) ** 2) / np.mean(healthy[name] ** 2))
        assert error == pytest.approx(by_hand)
    assert list(found.relative_error) == [name for name in SCHEMA if name in found.relative_error]


def test_what_the_averaged_model_recorded_step_by_step_is_replayed_exactly() -> None:
    recording = simulate(THESIS, Chirp(), model="averaged", sampling="instant", sample_rate=1 / AVERAGED.step)
    errors = replay(recording, THESIS).relative_error
    # Every step's command is a row. What remains is rounding, of times to 1e-16 s, over 10,000 steps.
    assert set(errors) > {"position_rad", "speed_rad_s", "angle_rad", "current_A"}
    assert all(error < 1e-9 for error in errors.values())


def test_between_rows_the_command_is_a_chord() -> None:
    recording = simulate(THESIS, Chirp(), model="averaged", sampling="instant")
    errors = replay(recording, THESIS).relative_error
    # A chord misses (h w)² / 8 of a sine of frequency w, and 2/3 of that in the mean. Position and speed
    # follow the command; the current amplifies what is missed by position and speed gain.
    missed = (INTERVAL * FREQUENCY) ** 2 / 8
    for name in ("position_rad", "speed_rad_s", "angle_rad"):
        assert errors[name] < missed
    controller = THESIS.controller
    gain = controller.position_gain * controller.speed_gain / controller.torque_constant
    assert errors["current_A"] < missed * gain * 5e-3 / np.sqrt(np.mean(recording["current_A"] ** 2))


def test_means_of_the_averaged_model_are_replayed_to_half_a_step() -> None:
    recording = simulate(THESIS, Chirp(), model="averaged")
    errors = replay(recording, THESIS).relative_error
    # Its command is the mean over the steps' starts, so that it is half a step (25 µs) late.
    late = FREQUENCY * AVERAGED.step / 2
    assert errors["position_rad"] < 1.2 * late
    assert errors["speed_rad_s"] < 1.2 * late
    assert errors["current_A"] < 0.02


def test_the_reference_models_recording_is_replayed_but_for_its_ripple(healthy: Recording) -> None:
    errors = replay(healthy, THESIS).relative_error
    assert errors["position_rad"] < 5e-3
    assert errors["speed_rad_s"] < 5e-3
    # 0.08 A rms between the models (docs/physics.md, section 1) and 0.05 A of noise, of 2.4 A.
    assert errors["current_A"] < 0.06


def test_a_wrong_actuator_is_farther_off(healthy: Recording) -> None:
    right = replay(healthy, THESIS).relative_error["current_A"]
    for values in ({"inertia": 5e-5}, {"coulomb": 0.15}, {"position_gain": 7e4}):
        assert replay(healthy, with_totals(THESIS, values)).relative_error["current_A"] > 3 * right


def test_faults_are_replayed_where_they_are_given() -> None:
    faults = Faults(friction=0.5, short_a=0.3)
    recording = simulate(THESIS, Chirp(), faults=faults)
    healthy = replay(recording, THESIS).relative_error["current_A"]
    faulty = replay(recording, THESIS, faults=faults).relative_error["current_A"]
    assert faulty < 0.06 < 3 * 0.06 < healthy


def test_the_models_replay_one_another(healthy: Recording) -> None:
    for model, most in (("reference", 0.06), ("monitor", 0.15), ("averaged", 0.06)):
        assert replay(healthy, THESIS, model=model).relative_error["current_A"] < most


def test_an_ideal_current_loop_has_no_voltage() -> None:
    ideal = Actuator.from_dict(THESIS.model_dump() | {"electrical": None})
    recording = simulate(THESIS, Chirp(), model="averaged")
    assert "voltage_V" in recording
    assert "voltage_V" not in replay(recording, ideal).relative_error


def test_the_json_has_what_the_design_asks_for(healthy: Recording) -> None:
    found = replay(healthy, THESIS)
    read = json.loads(found.to_json())
    assert read["relative_error"] == found.relative_error
    assert (read["model"], read["actuator"], read["recording"]) == ("averaged", "thesis", healthy.source)
    for name, error in found.relative_error.items():
        assert f"{100 * error:.4g} %" in next(line for line in str(found).splitlines() if name in line)


def test_a_channel_that_is_zero_throughout_leaves_the_json_valid(healthy: Recording) -> None:
    jammed = Recording(dict(healthy.channels) | {"speed_rad_s": np.zeros(healthy.samples)})

    def refuse(text: str) -> None:
        pytest.fail(f"{text} is no JSON")

    json.loads(replay(jammed, THESIS).to_json(), parse_constant=refuse)


def test_an_unknown_model_is_answered_with_the_nearest(healthy: Recording) -> None:
    with pytest.raises(MethodError, match="did you mean 'monitor'"):
        replay(healthy, THESIS, model="moniter")


def test_a_recording_in_foreign_units_is_refused(healthy: Recording) -> None:
    milliamperes = Recording(dict(healthy.channels) | {"current_A": 1e3 * healthy["current_A"]})
    with pytest.raises(RecordingError, match="milliamperes"):
        replay(milliamperes, THESIS)
