"""A replay compares the model with each channel of a recording, by relative errors and errors in units."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from cases import INTERVAL, THESIS
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.actuator.quantity import unit_for
from emaphm.arrays import Array
from emaphm.errors import MethodError, RecordingError
from emaphm.estimation import replay, replay_all
from emaphm.estimation.replay import write_series
from emaphm.estimation.replay.errors import ErrorStatistics
from emaphm.recording import Recording
from emaphm.recording.schema import SCHEMA
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED

FREQUENCY = 2 * np.pi * 15
"""Highest angular frequency of the chirp [rad/s]."""


def relative(name: str, measured: Array, modelled: Array) -> float | None:
    return ErrorStatistics.of(name, [(measured, modelled)]).relative


def test_the_relative_error_agrees_with_values_by_hand() -> None:
    # Differences 1, 0, 2, 2: rms 1.5. Measured 3, 3, 5, 1: rms sqrt(11).
    measured, modelled = np.array([3.0, 3.0, 5.0, 1.0]), np.array([2.0, 3.0, 3.0, -1.0])
    assert relative("current_A", measured, modelled) == pytest.approx(1.5 / np.sqrt(11))
    assert relative("current_A", measured, measured) == 0
    assert relative("current_A", 0 * measured, modelled) is None


@given(
    angle=arrays(np.float64, 10, elements=st.floats(1, 9)),
    turns=arrays(np.int64, 10, elements=st.integers(-3, 3)),
)
def test_angles_are_compared_modulo_a_turn(angle: Array, turns: NDArray[np.int64]) -> None:
    assume(np.ptp(angle) > 0.1)
    assert relative("angle_rad", angle, angle + 2 * np.pi * turns) == pytest.approx(0, abs=1e-12)
    off = relative("angle_rad", angle, angle + 2 * np.pi * turns + 0.1)
    assert off == pytest.approx(0.1 / np.sqrt(np.mean((angle - angle[0]) ** 2)))


def test_a_recorded_temperature_changes_the_model() -> None:
    assert THESIS.electrical is not None
    hot = with_lumped_parameters(
        THESIS,
        {
            "resistance": lumped_parameters(THESIS, ("resistance",))["resistance"] * (1 + 3.93e-3 * 60),
            "torque_constant": lumped_parameters(THESIS, ("torque_constant",))["torque_constant"]
            * (1 - 1.1e-3 * 60),
        },
    )
    whole = simulate(hot, Chirp(stop_hz=15.0, duration=0.3), model="averaged", duration=0.3)
    kept = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")}
    known = kept | {"temperature_K": np.full(whole.samples, THESIS.electrical.temperature + 60.0)}
    cold, with_temperature = (replay(Recording(columns), THESIS).relative_error for columns in (kept, known))
    assert all(with_temperature[name] < 0.5 * cold[name] for name in cold)


def test_each_channel_common_to_model_and_schema_has_a_relative_error(healthy: Recording) -> None:
    result = replay(healthy, THESIS)
    assert set(result.relative_error) == {
        "position_rad",
        "speed_rad_s",
        "angle_rad",
        "current_A",
        "voltage_V",
    }
    for name, error in result.relative_error.items():
        by_hand = np.sqrt(np.mean((healthy[name] - result.signals[name]) ** 2) / np.mean(healthy[name] ** 2))
        assert error == pytest.approx(by_hand)
    assert list(result.relative_error) == [name for name in SCHEMA if name in result.relative_error]


def test_a_recording_of_the_averaged_model_at_its_steps_is_replayed_exactly() -> None:
    recording = simulate(THESIS, Chirp(), model="averaged", sampling="instant", sample_rate=1 / AVERAGED.step)
    errors = replay(recording, THESIS).relative_error
    # Each step has its row of the command. The remaining error is rounding of times, over 10,000 steps.
    assert set(errors) > {"position_rad", "speed_rad_s", "angle_rad", "current_A"}
    assert all(error < 1e-9 for error in errors.values())


def test_between_instants_the_replay_has_the_error_of_a_chord() -> None:
    recording = simulate(THESIS, Chirp(), model="averaged", sampling="instant")
    errors = replay(recording, THESIS).relative_error
    # A chord has an error of (h w)² / 8 of a sine of frequency w, 2/3 of that in the mean. Position and speed
    # follow the command; position and speed gain amplify the error in the current.
    chord_error = (INTERVAL * FREQUENCY) ** 2 / 8
    for name in ("position_rad", "speed_rad_s", "angle_rad"):
        assert errors[name] < chord_error
    controller = THESIS.controller
    gain = controller.position_gain * controller.speed_gain / THESIS.drive_constant
    assert errors["current_A"] < chord_error * gain * 5e-3 / np.sqrt(np.mean(recording["current_A"] ** 2))


def test_means_of_the_averaged_model_are_replayed_within_half_a_step() -> None:
    recording = simulate(THESIS, Chirp(), model="averaged")
    errors = replay(recording, THESIS).relative_error
    # The command is the mean over the starts of the steps, so that it is half a step (25 µs) late.
    late = FREQUENCY * AVERAGED.step / 2
    assert errors["position_rad"] < 1.2 * late
    assert errors["speed_rad_s"] < 1.2 * late
    assert errors["current_A"] < 0.02


def test_a_recording_of_the_reference_model_is_replayed_except_for_its_ripple(healthy: Recording) -> None:
    errors = replay(healthy, THESIS).relative_error
    assert errors["position_rad"] < 5e-3
    assert errors["speed_rad_s"] < 5e-3
    # 0.08 A rms between the models (docs/physics.md, section 1) and 0.05 A of noise, relative to 2.4 A.
    assert errors["current_A"] < 0.06


def test_a_wrong_actuator_has_a_larger_error(healthy: Recording) -> None:
    right = replay(healthy, THESIS).relative_error["current_A"]
    for values in ({"inertia": 5e-5}, {"coulomb": 0.15}, {"position_gain": 7e4}):
        assert replay(healthy, with_lumped_parameters(THESIS, values)).relative_error["current_A"] > 3 * right


def test_given_faults_are_replayed() -> None:
    faults = Faults(friction=0.5, short_a=0.3)
    recording = simulate(THESIS, Chirp(), faults=faults)
    healthy = replay(recording, THESIS).relative_error["current_A"]
    faulty = replay(recording, THESIS, faults=faults).relative_error["current_A"]
    assert faulty < 0.06 < 3 * 0.06 < healthy


def test_the_models_replay_recordings_of_each_other(healthy: Recording) -> None:
    for model, most in (("reference", 0.06), ("monitor", 0.15), ("averaged", 0.06)):
        assert replay(healthy, THESIS, model=model).relative_error["current_A"] < most


def test_an_ideal_current_loop_has_no_voltage() -> None:
    ideal = Actuator.from_dict(THESIS.model_dump() | {"electrical": None})
    recording = simulate(THESIS, Chirp(), model="averaged")
    assert "voltage_V" in recording
    assert "voltage_V" not in replay(recording, ideal).relative_error


def test_the_json_has_the_documented_keys(healthy: Recording) -> None:
    result = replay(healthy, THESIS)
    read = json.loads(result.to_json())
    assert read["relative_error"] == result.relative_error
    assert (read["model"], read["actuator"], read["recording"]) == ("averaged", "thesis", healthy.source)
    for name, error in result.relative_error.items():
        assert f"{100 * error:.4g} %" in next(line for line in str(result).splitlines() if name in line)


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


def test_errors_in_units_agree_with_values_by_hand() -> None:
    # Differences 1, 0, 2, -2.
    measured, modelled = np.array([3.0, 3.0, 5.0, -1.0]), np.array([2.0, 3.0, 3.0, 1.0])
    single = ErrorStatistics.of("position_rad", [(measured, modelled)])
    assert (single.mean_absolute, single.rms) == pytest.approx((1.25, 1.5))
    # Over all rows of two recordings: differences 1, 0, 2, -2 and 0, 0.
    joint = ErrorStatistics.of("position_rad", [(measured, modelled), (np.zeros(2), np.zeros(2))])
    assert (joint.mean_absolute, joint.rms) == pytest.approx((5 / 6, np.sqrt(9 / 6)))
    assert ErrorStatistics.of("position_rad", [(np.zeros(2), np.ones(2))]).relative is None


def test_errors_in_units_are_reported_with_the_relative_error(healthy: Recording) -> None:
    result = replay(healthy, THESIS)
    answer = result.to_dict()
    assert (
        answer["mean_absolute_error"].keys() == answer["rms_error"].keys() == answer["relative_error"].keys()
    )
    for name, error in result.rms_error.items():
        difference = healthy[name] - result.signals[name]
        assert error == pytest.approx(np.sqrt(np.mean(difference**2)))
        assert result.mean_absolute_error[name] == pytest.approx(np.mean(np.abs(difference)))
        line = next(line for line in str(result).splitlines() if line.startswith(name))
        assert f"{result.mean_absolute_error[name]:.4g}" in line
        assert f"{error:.4g}" in line
        assert unit_for(SCHEMA[name].unit, "rotary") in line
    assert answer["warnings"] == answer["notes"] == []


def test_a_channel_that_is_zero_throughout_has_an_error_in_its_unit(healthy: Recording) -> None:
    jammed = replay(Recording(dict(healthy.channels) | {"speed_rad_s": np.zeros(healthy.samples)}), THESIS)
    assert jammed.rms_error["speed_rad_s"] > 0
    assert "speed_rad_s" not in jammed.relative_error


def test_the_relative_error_of_a_position_does_not_depend_on_its_zero() -> None:
    away_from_zero, about_zero = (
        simulate(THESIS, Chirp(about=about), model="averaged", duration=0.2) for about in (0.3, 0.0)
    )
    for whole, about in ((away_from_zero, 0.3), (about_zero, 0.0)):
        mirrored = Recording(
            {n: whole[n] for n in whole.names} | {"position_rad": 2 * about - whole["position_rad"]}
        )
        result = replay(mirrored, THESIS, model="averaged")
        assert result.relative_error["position_rad"] == pytest.approx(2.0, rel=0.01)
        assert any("position_rad deviates by" in warning for warning in result.warnings)


def test_a_model_unlike_the_recording_causes_a_warning(healthy: Recording) -> None:
    reversed_sign = Recording(dict(healthy.channels) | {"position_rad": -healthy["position_rad"]})
    result = replay(reversed_sign, THESIS)
    (warning,) = result.warnings
    for piece in ("position_rad deviates by", "%", "unit", "sign", "[channels]"):
        assert piece in warning
    assert f"Warning: {warning}." in str(result)
    assert result.to_dict()["warnings"] == [warning]


@pytest.mark.parametrize("name", ["position_rad", "speed_rad_s", "voltage_V"])
def test_one_channel_is_sufficient(healthy: Recording, name: str) -> None:
    recording = Recording({kept: healthy[kept] for kept in ("time_s", "command_rad", name)})
    result = replay(recording, THESIS)
    assert list(result.relative_error) == [name]
    whole = replay(healthy, THESIS)
    assert result.relative_error[name] == pytest.approx(whole.relative_error[name], rel=0.05)


def test_a_channel_that_no_model_has_is_refused(healthy: Recording) -> None:
    given = {name: healthy[name] for name in ("time_s", "command_rad")}
    with pytest.raises(
        MethodError, match=r"\(duty\) can be compared with the averaged model .* record one of"
    ):
        replay(Recording(given | {"duty": healthy["voltage_V"] / 48}), THESIS)


def test_notes_on_the_recording_are_reported(healthy: Recording) -> None:
    moves = np.random.default_rng(0).uniform(-0.05, 0.05, healthy.samples)
    jittered = dict(healthy.channels) | {"time_s": healthy["time_s"] + INTERVAL * moves}
    result = replay(Recording(jittered), THESIS)
    (note,) = result.to_dict()["notes"]
    assert "resampled" in note
    assert f"Note: {note}." in str(result)
    # The values were not shifted with the clock, so that their error is the jitter times their slope.
    assert result.relative_error["position_rad"] < 5e-3


def test_several_recordings_have_a_joint_error(healthy: Recording, shorted: Recording) -> None:
    result = replay_all([healthy, shorted], THESIS)
    answer = result.to_dict()
    assert answer["recordings"] == [replay(recording, THESIS).to_dict() for recording in (healthy, shorted)]
    singles = [recording["rms_error"]["current_A"] for recording in answer["recordings"]]
    assert answer["rms_error"]["current_A"] == pytest.approx(np.sqrt(np.mean(np.square(singles))))
    assert min(singles) < answer["rms_error"]["current_A"] < max(singles)
    text = str(result)
    assert text.count("mean abs. error") == 3
    assert "All 2 recordings" in text
    json.loads(result.to_json())
    assert replay_all([healthy], THESIS).to_dict() == replay(healthy, THESIS).to_dict()
    with pytest.raises(MethodError, match="no recording"):
        replay_all([], THESIS)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_signals_are_written_side_by_side(healthy: Recording, tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"series.{ending}"
    result = replay(healthy, THESIS)
    write_series([result], path)
    table = pl.read_csv(path) if ending == "csv" else pl.read_parquet(path)
    assert table.columns[:4] == ["time_s", "command_rad", "position_rad", "position_rad_model"]
    for name in result.errors:
        np.testing.assert_array_equal(table[name], healthy[name])
        np.testing.assert_array_equal(table[f"{name}_model"], result.signals[name])


def test_signals_of_several_recordings_are_labelled_by_recording(healthy: Recording, tmp_path: Path) -> None:
    bare = Recording({name: healthy[name] for name in ("time_s", "command_rad", "current_A")}, source="bare")
    write_series(replay_all([healthy, bare], THESIS).replays, tmp_path / "series.csv")
    table = pl.read_csv(tmp_path / "series.csv")
    assert table["recording"].unique().sort().to_list() == sorted([healthy.source, "bare"])
    rows = table.filter(pl.col("recording") == "bare")
    assert rows["position_rad_model"].null_count() == healthy.samples == rows["current_A"].len()
