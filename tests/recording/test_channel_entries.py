"""Channel entries of a description: conversion, derived and known values, delays, masks and gaps."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from emaphm.actuator import Actuator
from emaphm.actuator.channels import Channels
from emaphm.actuator.reading import Reading
from emaphm.errors import RecordingError
from emaphm.recording import Recording, read_recording, write_recording

from .conftest import Columns, Refusal


# A CSV file where the format does not matter, because other formats need a process of their own.
def save(columns: dict[str, Any], folder: Path, name: str = "rec.csv") -> Path:
    path = folder / name
    frame = pl.DataFrame(columns)
    frame.write_csv(path) if name.endswith("csv") else frame.write_parquet(path)
    return path


def rig(thesis: Actuator, reading: dict[str, Any] | None = None, **channels: Any) -> Actuator:
    sections = {"channels": Channels(**channels), "reading": Reading(**(reading or {}))}
    return thesis.model_copy(update=sections)


def test_unit_scale_offset_and_sign_are_applied(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    logged = {
        "t": 1e3 * columns["time_s"],
        "goal": np.rad2deg(columns["command_rad"]),
        "counts": -(columns["current_A"] / 0.01) + 2048,
        "celsius": columns["temperature_K"] - 273.15,
        "rpm": columns["speed_rad_s"] * 30 / np.pi,
    }
    actuator = rig(
        thesis,
        time_s={"column": "t", "unit": "ms"},
        command_rad={"column": "goal", "unit": "deg"},
        current_A={"column": "counts", "scale": 0.01, "offset": -20.48, "sign": -1},
        temperature_K={"column": "celsius", "unit": "degC"},
        speed_rad_s={"column": "rpm", "unit": "rpm"},
    )
    recording = read_recording(save(logged, tmp_path), actuator)
    for name in ("time_s", "command_rad", "current_A", "temperature_K", "speed_rad_s"):
        np.testing.assert_allclose(recording[name], columns[name], rtol=1e-12, atol=1e-12, err_msg=name)


def test_a_channel_is_derived_from_columns_and_from_channels(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    error_mrad = 1e3 * (columns["command_rad"] - columns["position_rad"])
    logged = {k: v for k, v in columns.items() if k != "position_rad"} | {"error": error_mrad}
    actuator = rig(thesis, position_rad={"derived": "command_rad - 0.001 * error"})
    recording = read_recording(save(logged, tmp_path), actuator)
    np.testing.assert_allclose(recording["position_rad"], columns["position_rad"], atol=1e-15)


def test_a_channel_derived_from_channels_only_is_computed(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    channels = {
        "current_A": {"derived": "2 * current_A"},
        "load_Nm": {"derived": "0.01 * position_rad + 0.5"},
    }
    names = ("time_s", "command_rad", "current_A", "position_rad")
    recording = read_recording(save({n: columns[n] for n in names}, tmp_path), rig(thesis, **channels))
    np.testing.assert_allclose(recording["current_A"], 2 * columns["current_A"])
    np.testing.assert_allclose(recording["load_Nm"], 0.01 * columns["position_rad"] + 0.5)
    with pytest.raises(ValueError, match="time is a column of its own"):
        rig(thesis, time_s={"derived": "frame / 5000"})


def test_known_values_and_labels_are_read(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    del columns["temperature_K"]
    path = save(columns | {"SN": ["A-17"] * 2500, "run": np.full(2500, 3)}, tmp_path)
    actuator = rig(thesis, {"serial": "SN"}, temperature_K={"value": 20.0, "unit": "degC"})
    recording = read_recording(path, actuator, known={"load_Nm": 0.02, "rig": "left"})
    np.testing.assert_allclose(recording["temperature_K"], 293.15)
    np.testing.assert_array_equal(recording["load_Nm"], 0.02)
    assert recording.labels == {"SN": "A-17", "serial": "A-17", "run": 3.0, "rig": "left"}
    # Writing keeps them.
    write_recording(recording, tmp_path / "again.csv")
    assert read_recording(tmp_path / "again.csv", thesis).labels["serial"] == "A-17"


@pytest.mark.parametrize("serial", ["0042", "1E5"])
def test_a_serial_number_with_the_same_value_as_another_keeps_its_text(
    columns: Columns, tmp_path: Path, thesis: Actuator, serial: str
) -> None:
    path = save(columns | {"SN": [serial] * 2500, "step": [f"{i:04d}" for i in range(2500)]}, tmp_path)
    actuator = rig(thesis, {"serial": "SN"}, load_Nm={"derived": "step / 2500"})
    recording = read_recording(path, actuator)
    assert recording.labels["serial"] == serial
    np.testing.assert_allclose(recording["load_Nm"], np.arange(2500) / 2500)
    write_recording(recording, tmp_path / "again.csv")
    assert read_recording(tmp_path / "again.csv", thesis).labels["serial"] == serial


def test_a_label_is_kept_despite_lost_rows(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    kept = np.delete(np.arange(2500), [700, 701, 1200])
    lost = {**columns, "run": np.ones(2500), "ambient": np.sin(columns["time_s"])}
    path = save({name: values[kept] for name, values in lost.items()}, tmp_path)
    recording = read_recording(path, thesis)
    assert recording.samples == 2500
    # In lost rows, the values of a changing column are unknown.
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(recording["ambient"])), [700, 701, 1200])
    write_recording(recording, tmp_path / "again.csv")
    reread = read_recording(tmp_path / "again.csv", thesis)
    assert reread.labels["run"] == recording.labels["run"] == 1.0


@pytest.mark.parametrize(("sampling", "atol"), [("instant", 2e-8), ("mean", 2e-8)])
@pytest.mark.parametrize("delay", [2e-3, 1.37e-3, -0.61e-3])
def test_a_delay_is_compensated(
    columns: Columns, tmp_path: Path, thesis: Actuator, sampling: str, atol: float, delay: float
) -> None:
    swing = 2 * np.pi * 4.0
    time = columns["time_s"]
    # Means over a row's interval of 0.2 ms of a sine at 4 Hz differ from its middle by 1e-6 of it.
    shift = 1e-4 if sampling == "mean" else 0.0
    columns["position_rad"] = 5e-3 * np.sin(swing * (time + shift - delay) - 0.05)
    actuator = rig(thesis, sampling=sampling, position_rad={"delay_s": delay})
    recording = read_recording(save(columns, tmp_path), actuator)
    expected = 5e-3 * np.sin(swing * (recording["time_s"] + shift) - 0.05)
    np.testing.assert_allclose(recording["position_rad"], expected, atol=atol)
    lost = 2500 - recording.samples
    assert abs(delay) * 5000 <= lost <= abs(delay) * 5000 + 2
    assert "delay" in recording.notes[0]


@pytest.mark.parametrize("name", ["rec.csv", "rec.parquet"])
def test_short_gaps_are_interpolated_with_a_note(
    columns: Columns, tmp_path: Path, thesis: Actuator, name: str
) -> None:
    spoilt = {key: [None if np.isnan(x) else x for x in values] for key, values in columns.items()}
    for row in (40, 41, 42, 900, 2499):
        spoilt["position_rad"][row] = None
    recording = read_recording(save(spoilt, tmp_path, name), thesis)
    assert recording.samples == 2499
    np.testing.assert_allclose(recording["position_rad"], columns["position_rad"][:2499], atol=1e-8)
    np.testing.assert_array_equal(recording["current_A"], columns["current_A"][:2499])
    assert "the last 1 row left out, where position_rad is empty" in recording.notes[0]
    assert "position_rad: 4 empty cells in 2 gaps, the first at 0.008 s, interpolated" in recording.notes[1]


def test_lost_rows_are_interpolated_with_a_note(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    kept = np.delete(np.arange(2500), [100, 101, 700])
    path = save({name: values[kept] for name, values in columns.items()}, tmp_path)
    recording = read_recording(path, thesis)
    np.testing.assert_allclose(recording["time_s"], columns["time_s"], atol=1e-12)
    np.testing.assert_allclose(recording["position_rad"], columns["position_rad"], atol=1e-8)
    assert "3 rows lost in 2 places" in recording.notes[0]


def test_a_log_with_more_gaps_than_allowed_is_refused(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    columns["position_rad"][100:110] = np.nan
    path = save(columns, tmp_path)
    assert "row 101 of column 'position_rad' is empty" in refusal(lambda: read_recording(path, thesis))
    assert read_recording(path, rig(thesis, {"longest_gap": 10})).samples == 2500


def test_a_long_gap_of_a_column_with_its_own_times_is_refused(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    columns["own"] = columns["time_s"] + 1e-5
    columns["position_rad"][300:700] = np.nan
    actuator = rig(thesis, position_rad={"column": "position_rad", "time": "own"})
    path = save(columns, tmp_path)
    assert "of column 'position_rad' is empty" in refusal(lambda: read_recording(path, actuator))
    columns["position_rad"][300:700] = np.linspace(0.0, 1.0, 400)
    columns["position_rad"][300:302] = np.nan
    assert read_recording(save(columns, tmp_path), actuator).samples >= 2499


def test_a_condition_on_a_channel_does_not_change_its_conversion(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    path = save(columns, tmp_path)
    actuator = rig(thesis, {"keep": "position_rad > -100"}, position_rad={"unit": "deg"})
    recording = read_recording(path, actuator)
    np.testing.assert_allclose(recording["position_rad"], np.deg2rad(columns["position_rad"]))


@pytest.mark.parametrize("reading", [{}, {"low_pass_hz": 400.0}])
def test_a_wrapped_angle_is_interpolated_and_shifted_like_an_unwrapped_one(
    columns: Columns, tmp_path: Path, thesis: Actuator, reading: dict[str, Any]
) -> None:
    true = 30.0 * columns["time_s"]
    columns["angle_rad"] = np.rad2deg(true) % 360.0
    columns["angle_rad"][500] = np.nan
    columns["own"] = columns["time_s"] + 0.4e-4
    late = read_recording(
        save(columns, tmp_path), rig(thesis, reading, angle_rad={"time": "own", "unit": "deg"})
    )["angle_rad"]
    # The column's own times are 0.04 ms later; the angle moves up to 1.2 mrad in that time.
    away = (late - true[-late.size :] + 30.0 * 0.4e-4 + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(away[50:-50]).max() < 2e-3


def test_a_channel_that_is_ignored_is_not_read(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    path = save(columns | {"rpm": columns["speed_rad_s"]}, tmp_path)
    ignored = read_recording(path, rig(thesis, {"ignore": ["speed_rad_s"]}))
    assert "speed_rad_s" not in ignored.names
    assert "position_rad" in ignored.names
    by_entry = rig(thesis, {"ignore": ["speed_rad_s"]}, speed_rad_s={"column": "rpm"})
    assert "speed_rad_s" not in read_recording(path, by_entry).names
    motion = ["current_A", "position_rad", "speed_rad_s"]
    nothing = refusal(lambda: read_recording(path, rig(thesis, {"ignore": [*columns.keys() & set(motion)]})))
    assert "current_A" in nothing
    for name, words in (("speed", "did you mean 'speed_rad_s'"), ("time_s", "needed of every recording")):
        with pytest.raises(ValueError, match=words):
            Reading(ignore=[name])


def test_masked_rows_are_left_out(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    mode = np.where(columns["time_s"] < 0.3, "trap", "sine")
    path = save(columns | {"on": (columns["time_s"] >= 0.1) * 1, "mode": mode}, tmp_path)
    by_condition = read_recording(path, rig(thesis, {"keep": "on == 1 and mode == 'trap'"}))
    np.testing.assert_allclose(by_condition["time_s"][[0, -1]], [0.1, 0.2998])
    by_time = read_recording(path, rig(thesis, {"times": [[0.1, 0.2998]]}))
    np.testing.assert_array_equal(by_time["time_s"], by_condition["time_s"])
    several = refusal(lambda: read_recording(path, rig(thesis, {"times": [[0.1, 0.2], [0.3, 0.4]]})))
    assert "leave 2 recordings" in several


def test_dwell_rows_are_left_out(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    moving = columns["time_s"] < 0.25
    columns["command_rad"] = np.where(moving, columns["command_rad"], columns["command_rad"][1250])
    recording = read_recording(save(columns, tmp_path), rig(thesis, {"dwell_s": 0.1}))
    assert abs(recording.samples - 1250) <= 2


def test_low_pass_has_its_bandwidth_and_no_phase(tmp_path: Path, thesis: Actuator) -> None:
    time = np.arange(5000) / 1e3
    slow, fast = np.sin(2 * np.pi * 2 * time), np.sin(2 * np.pi * 50 * time)
    path = save({"time_s": time, "command_rad": slow, "current_A": slow + fast}, tmp_path)
    recording = read_recording(path, rig(thesis, {"low_pass_hz": 50.0}))
    # At the bandwidth, the amplitude is 1/√2; a sine of 2 Hz has no delay.
    middle = slice(1000, 4000)
    expected = slow + fast / np.sqrt(2)
    np.testing.assert_allclose(recording["current_A"][middle], expected[middle], atol=0.002)
    np.testing.assert_array_equal(recording["command_rad"], slow)
    assert "zero-phase low-pass with a bandwidth of 50 Hz" in recording.notes[-1]
    with pytest.raises(RecordingError, match="low_pass_hz = 1e-07 leaves nothing"):
        read_recording(path, rig(thesis, {"low_pass_hz": 1e-7}))


def test_behind_a_screw_the_output_is_in_m_and_the_motor_in_rad(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    screw = rig(thesis, command_rad={"unit": "mm"}, position_rad={"unit": "um"}, speed_rad_s={"unit": "rpm"})
    screw = screw.model_copy(update={"coordinates": "screw"})
    recording = read_recording(save(columns, tmp_path), screw)
    for name, factor in (("command_rad", 1e-3), ("position_rad", 1e-6), ("speed_rad_s", np.pi / 30)):
        np.testing.assert_allclose(recording[name], factor * columns[name], rtol=1e-12)
    labels = [axis.get_ylabel() for axis in recording.plot(coordinates="screw").axes]
    assert "command\n[m]" in labels
    assert "speed of the motor\n[rad/s]" in labels


BAD: dict[str, tuple[dict[str, Any], dict[str, Any], list[str]]] = {
    "another quantity": (
        {},
        {"current_A": {"unit": "mm"}},
        ["unit of current_A", "mm does not convert into A"],
    ),
    "a length for an angle": (
        {},
        {"position_rad": {"unit": "mm"}},
        ["unit of position_rad", 'correct the unit, or set coordinates = "linear" or "screw"'],
    ),
    "a long delay": (
        {},
        {"position_rad": {"delay_s": 0.6}},
        ["delay_s = 0.6 of position_rad", "longer than"],
    ),
    "an unknown operand": (
        {},
        {"load_Nm": {"derived": "forc * number"}},
        ["no column 'forc'", "did you mean 'force'"],
    ),
    "a mask that leaves nothing": (
        {"keep": "force > 9"},
        {},
        ['keep = "force > 9"', "leaves no row of 2500"],
    ),
    "times that leave nothing": ({"times": [[7.0, 8.0]]}, {}, ["times = [[7.0, 8.0]]", "leaves no row"]),
    "a mask of an unknown column": ({"keep": "enable == 1"}, {}, ["no column 'enable'", "keep"]),
    "a mask of texts and numbers": ({"keep": "mode > 1"}, {}, ["keep", "text"]),
    "a mask of texts alone": ({"keep": "mode"}, {}, ["keep", "text"]),
    "a mask of negated texts": ({"keep": "not mode"}, {}, ["keep", "text"]),
    "an unknown serial number": ({"serial": "SN"}, {}, ["column 'SN'", "not in the file"]),
    "a serial number that changes": ({"serial": "number"}, {}, ["'number'", "not the same throughout"]),
    "a low-pass beyond the rate": ({"low_pass_hz": 2500.0}, {}, ["low_pass_hz = 2500", "5000 Hz"]),
}


@pytest.mark.parametrize(("reading", "channels", "expected"), BAD.values(), ids=BAD.keys())
def test_impossible_entries_are_refused(
    columns: Columns,
    tmp_path: Path,
    thesis: Actuator,
    refusal: Refusal,
    reading: dict[str, Any],
    channels: dict[str, Any],
    expected: list[str],
) -> None:
    further = {"force": np.ones(2500), "mode": ["a"] * 2500, "number": np.arange(2500)}
    path = save(columns | further, tmp_path)
    text = refusal(lambda: read_recording(path, rig(thesis, reading, **channels)))
    for part in (str(path), *expected):
        assert part in text


def test_a_known_command_is_refused(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    path = save(columns, tmp_path)
    assert "cannot hold" in refusal(lambda: read_recording(path, thesis, known={"command_rad": 1.0}))


def test_jitter_up_to_a_fifth_is_resampled_with_a_note(columns: Columns) -> None:
    random = np.random.default_rng(0)
    steps = 2e-4 * (1 + np.clip(random.normal(0, 0.2, 2499), -0.7, 0.7))
    time = np.append(0.0, np.cumsum(steps))
    columns |= {"time_s": time, "command_rad": 5e-3 * np.sin(2 * np.pi * 4 * time)}
    recording = Recording(columns, "instant")
    expected = 5e-3 * np.sin(2 * np.pi * 4 * recording["time_s"])
    np.testing.assert_allclose(recording["command_rad"], expected, atol=1e-8)
    assert "resampled" in recording.notes[0]


@pytest.mark.parametrize("longest_gap", [3, 5])
def test_a_gap_next_to_rows_left_out_for_another_channel_is_left_out(
    columns: Columns, tmp_path: Path, thesis: Actuator, longest_gap: int
) -> None:
    columns["command_rad"][:3] = columns["command_rad"][-2:] = np.nan
    columns["current_A"][3:6] = columns["current_A"][-5:-1] = np.nan
    path, actuator = save(columns, tmp_path), rig(thesis, {"longest_gap": longest_gap})
    if longest_gap < 4:  # the last gap of the current is a long one, also in its remaining part
        with pytest.raises(RecordingError, match="row 2496 of column 'current_A' is empty"):
            read_recording(path, actuator)
        return
    recording = read_recording(path, actuator)
    np.testing.assert_array_equal(recording["time_s"], columns["time_s"][6:-5])
    assert "the first 6 rows and the last 5 rows left out" in recording.notes[0]


def test_a_message_names_the_row_of_the_file(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    columns["command_rad"][:3] = np.nan  # left out
    columns = {name: np.delete(values, [700, 701]) for name, values in columns.items()}  # interpolated
    columns["current_A"][1000] = np.inf
    with pytest.raises(RecordingError, match="row 1001 of column 'current_A' is empty or"):
        read_recording(save(columns, tmp_path), thesis)


def test_a_file_without_foreign_names_is_read_by_schema_names_with_a_note(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    actuator = rig(thesis, {"keep": "on == 1"}, load_Nm="force", current_A={"column": "I", "unit": "mA"})
    recording = read_recording(save(columns, tmp_path), actuator)
    np.testing.assert_array_equal(recording["current_A"], columns["current_A"])
    assert recording.notes[0].endswith("without load_Nm, the entry of current_A, what [reading] asks for")


CHANGED = (
    {"sign": -1},
    {"column": "current_A", "scale": 2},
    {"unit": "rad"},
    {"delay_s": 1e-3},
    {"derived": "2 * current_A"},
)


@pytest.mark.parametrize("changed", CHANGED, ids=str)
def test_an_entry_of_a_present_column_is_not_dropped_because_another_is_missing(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal, changed: dict[str, Any]
) -> None:
    path = save({name: columns[name] for name in ("time_s", "command_rad", "current_A")}, tmp_path)
    text = refusal(lambda: read_recording(path, rig(thesis, current_A=changed, position_rad="pos")))
    for part in ("no column 'pos'", "for position_rad", "if emaphm wrote the file", "current_A"):
        assert part in text


def test_a_file_written_by_emaphm_is_not_converted_twice(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    path = save(columns, tmp_path)
    recording = read_recording(path, rig(thesis, current_A={"sign": -1}, position_rad="pos"))
    np.testing.assert_array_equal(recording["current_A"], columns["current_A"])
    assert recording.notes[0].endswith("without the entry of position_rad, the entry of current_A")
    wrong = rig(thesis, current_A={"unit": "rad"}, position_rad="pos")
    assert "rad does not convert into A" in refusal(lambda: read_recording(path, wrong))


def test_entries_without_effect_or_without_their_column_leave_a_file_readable(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    entries: dict[str, Any] = {"position_rad": "pos", "current_A": "current_A", "voltage_V": {"unit": "mV"}}
    recording = read_recording(save(columns, tmp_path), rig(thesis, **entries))
    for name in ("current_A", "position_rad"):
        np.testing.assert_array_equal(recording[name], columns[name])
