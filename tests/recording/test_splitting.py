"""Splitting of a file into recordings: by columns, by the period of the command, at rests and at gaps."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from emaphm.actuator import Actuator
from emaphm.actuator.channels import Channels
from emaphm.actuator.reading import Reading
from emaphm.recording import read_recording, read_recordings
from emaphm.recording.conditioning.masks import at_rest
from emaphm.recording.splitting import command_period

from .conftest import Columns, Refusal, measured_file


def trapezoids(periods: float, rows: int, phase: float = 0.0) -> np.ndarray:
    """Return a command that moves up, rests, moves down and rests, each for a quarter of a period."""
    place = np.mod(np.arange(round(periods * rows)) / rows + phase, 1.0)
    return 5e-3 * np.interp(place, [0, 0.25, 0.5, 0.75, 1], [0, 1, 1, 0, 0])


# A CSV file where the format does not matter, because other formats need a process of their own.
def save(columns: Mapping[str, object], folder: Path) -> Path:
    path = folder / "long.csv"
    pl.DataFrame(columns).write_csv(path)
    return path


def long_file(folder: Path, periods: float = 5.4, **further: object) -> Path:
    command = trapezoids(periods, 1000)
    time = np.arange(command.size) / 1e3
    return save({"time_s": time, "command_rad": command, "current_A": np.cos(time), **further}, folder)


@pytest.mark.parametrize("rows", [100.0, 324.0, 1000.4, 77.7])
@pytest.mark.parametrize("phase", [0.0, 0.3])
def test_the_period_of_a_command_is_found(rows: float, phase: float) -> None:
    time = np.arange(2000)
    place = np.mod(time / rows + phase, 1.0)
    command = np.interp(place, [0, 0.25, 0.5, 0.75, 1], [0, 1, 1, 0, 0]) + 0.2 * np.sin(4 * np.pi * place)
    period = command_period(command)
    assert period is not None
    assert period == pytest.approx(rows, abs=0.2)


@pytest.mark.parametrize("command", [np.arange(500.0), np.sin(np.arange(1000) ** 1.5 / 300), np.ones(400)])
def test_a_command_that_does_not_repeat_has_no_period(command: np.ndarray) -> None:
    assert command_period(command) is None


def test_a_file_is_split_by_period(tmp_path: Path, thesis: Actuator) -> None:
    recordings = read_recordings(long_file(tmp_path), thesis, split="period")
    assert [recording.samples for recording in recordings] == [1000] * 5
    assert [recording.labels["period"] for recording in recordings] == [1, 2, 3, 4, 5]
    assert "the 400 rows after this period" in recordings[-1].notes[0]
    assert recordings[2].source.endswith("long.csv: period 3")


def test_a_file_is_split_at_rests(tmp_path: Path, thesis: Actuator) -> None:
    recordings = read_recordings(long_file(tmp_path, 2.0), thesis, split="rests")
    # Up, down, up, down: split in the middle of each rest of 0.25 s.
    np.testing.assert_allclose(
        [recording["time_s"][0] for recording in recordings], [0, 0.375, 0.875, 1.375], atol=2e-3
    )
    assert sum(recording.samples for recording in recordings) == 2000


def test_a_file_is_split_by_columns_of_numbers_and_texts(
    tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    run = np.repeat([1, 2, 2, 1], [1000, 1000, 1000, 2400])
    load = np.repeat(["low", "high"], [1500, 3900])
    path = long_file(tmp_path, run=run, load=load)
    recordings = read_recordings(path, thesis, split="run, load")
    assert [
        (recording.labels["run"], recording.labels["load"], recording.samples) for recording in recordings
    ] == [
        (1, "low", 1000),
        (2, "low", 500),
        (2, "high", 1500),
        (1, "high", 2400),
    ]
    by_run = read_recordings(path, thesis, split="run")
    assert [recording.source.rpartition(": ")[2] for recording in by_run] == [
        "run 1",
        "run 2",
        "run 1, part 2",
    ]
    text = refusal(lambda: read_recordings(path, thesis, split="rnu"))
    assert "no column 'rnu' to cut by (did you mean 'run'?)" in text


def test_runs_with_large_numbers_have_distinct_names(tmp_path: Path, thesis: Actuator) -> None:
    run = np.repeat([20240101, 20240102, 0.1], [1000, 1000, 3400])
    recordings = read_recordings(long_file(tmp_path, run=run), thesis, split="run")
    names = [recording.source.rpartition(": ")[2] for recording in recordings]
    assert names == ["run 20240101", "run 20240102", "run 0.1"]


def test_a_file_is_split_at_gaps_masks_and_restarts_of_time(tmp_path: Path, thesis: Actuator) -> None:
    command = trapezoids(4.0, 1000)
    time = np.arange(4000) / 1e3
    time[1000:] += 0.5
    time[2000:] -= 2.5
    current = np.cos(time)
    current[3000:3020] = np.nan
    on = np.ones(4000)
    on[3500:3510] = 0
    path = save({"time_s": time, "command_rad": command, "current_A": current, "on": on}, tmp_path)
    actuator = thesis.model_copy(update={"reading": Reading(keep="on == 1", split="stretches")})
    refused: list[str] = []
    recordings = read_recordings(path, actuator, on_refused=refused.append)
    assert [recording.samples for recording in recordings] == [1000, 1000, 1000, 480, 490]
    assert not refused


def test_refused_pieces_are_reported(tmp_path: Path, thesis: Actuator, refusal: Refusal) -> None:
    run = np.repeat([1, 2, 3], [40, 960, 4400])
    current = np.cos(np.arange(5400.0))
    current[2000] = np.inf
    path = long_file(tmp_path, run=run)
    refused: list[str] = []
    assert len(read_recordings(path, thesis, split="run", on_refused=refused.append)) == 2
    assert [reason.rpartition(": ")[2] for reason in refused] == ["run 1 has 40 rows, at least 50 are needed"]
    path = save({**pl.read_csv(path).to_dict(as_series=False), "current_A": current}, tmp_path)
    assert "run 3: row 1001 of column 'current_A'" in refusal(
        lambda: read_recordings(path, thesis, split="run")
    )
    assert len(read_recordings(path, thesis, split="run", on_refused=refused.append)) == 1
    assert len(refused) == 3


def test_a_file_without_split_is_one_recording(columns: Columns, tmp_path: Path, thesis: Actuator) -> None:
    path = save(columns, tmp_path)
    (recording,) = read_recordings(path, thesis)
    for name in read_recording(path, thesis):
        np.testing.assert_array_equal(recording[name], columns[name])


def test_a_file_with_several_recordings_is_refused_as_a_single_one(
    tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    actuator = thesis.model_copy(update={"reading": Reading(split="period")})
    assert "makes 5 recordings" in refusal(lambda: read_recording(long_file(tmp_path), actuator))


def ball_screw(emps: Actuator) -> Actuator:
    channels = Channels(
        sampling="instant",
        time_s="time",
        command_rad={"column": "set_point", "unit": "mm"},
        position_rad={"derived": "set_point - position_error", "unit": "mm"},
        current_A="current",
        load_Nm={"column": "load", "unit": "kgf"},
    )
    return emps.model_copy(update={"channels": channels, "reading": Reading(split="load, run, group")})


@pytest.mark.parametrize("name", ["normal", "lackLubrication1", "backlash1"])
def test_a_real_log_of_some_150_cycles_is_split_by_cycle(emps: Actuator, name: str) -> None:
    path = measured_file("cranfield", f"{name}.parquet")
    recordings = read_recordings(path, ball_screw(emps))
    raw = pl.read_parquet(path)
    assert [recording.samples for recording in recordings] == [324] * (raw.height // 324)
    assert [recording.labels["load"] for recording in recordings] == raw["load"].to_list()[::324]
    assert [recording.labels["run"] for recording in recordings] == raw["run"].to_list()[::324]
    goal, error = raw["set_point"].to_numpy(), raw["position_error"].to_numpy()
    for number, recording in enumerate(recordings):
        rows = slice(324 * number, 324 * (number + 1))
        assert not recording.notes  # no value was cleaned
        np.testing.assert_allclose(recording["position_rad"], 1e-3 * (goal - error)[rows], rtol=1e-12)
        np.testing.assert_array_equal(recording["current_A"], raw["current"].to_numpy()[rows])
    np.testing.assert_allclose(recordings[0]["load_Nm"], 20 * 9.80665)


def test_a_log_of_a_real_servo_is_split_where_its_drive_is_off(emps: Actuator) -> None:
    path = measured_file("xl330", "kp200_lift_and_drop.csv")
    channels = Channels(sampling="instant", command_rad="goal_rad", enabled="torque_enable")
    reading = Reading(keep="torque_enable == 1", split="stretches")
    (held,) = read_recordings(path, emps.model_copy(update={"channels": channels, "reading": reading}))
    assert held.samples == 375
    assert held.labels["torque_enable"] == 1
    np.testing.assert_array_equal(held["enabled"], 1.0)


def test_lost_rows_and_empty_cells_shift_no_period(tmp_path: Path, thesis: Actuator) -> None:
    time = np.arange(5000) / 1e3
    command = np.interp(time % 0.5, [0.0, 0.1, 0.25, 0.35, 0.5], [0.0, 1.0, 1.0, 0.0, 0.0])
    command[1234] = np.nan
    rows = np.delete(np.arange(time.size), [100, 101, 1700, 1701, 1702, 3333])
    frame = {"time_s": time, "command_rad": command, "current_A": np.cos(time)}
    pl.DataFrame({name: values[rows] for name, values in frame.items()}).fill_nan(None).write_csv(
        tmp_path / "day.csv"
    )
    recordings = read_recordings(tmp_path / "day.csv", thesis, split="period")
    assert [recording.samples for recording in recordings] == [500] * 10
    assert [recording["time_s"][0] % 0.5 for recording in recordings] == pytest.approx([0.0] * 10, abs=1e-9)


def test_rounded_times_shift_no_period(tmp_path: Path, thesis: Actuator) -> None:
    # At 3 kHz, written in µs: the median step is 333 µs, the mean one 333.33.
    rows = np.arange(60_000)
    frame = {"time_s": np.round(rows / 3000.0, 6), "command_rad": 5e-3 * np.sin(2 * np.pi * rows / 1000)}
    recordings = read_recordings(save({**frame, "current_A": np.cos(rows)}, tmp_path), thesis, split="period")
    assert [recording.samples for recording in recordings] == [1000] * 60
    np.testing.assert_allclose(
        [recording["time_s"][0] for recording in recordings], np.arange(60) / 3, atol=1e-6
    )
    assert not any(recording.notes for recording in recordings)


@pytest.mark.parametrize("reading", [{"split": "stretches"}, {"times": [[0.0, 0.2]]}])
def test_an_empty_column_is_named_where_it_leaves_no_piece(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal, reading: dict[str, Any]
) -> None:
    path = tmp_path / "rec.csv"
    pl.DataFrame(columns | {"current_A": [None] * 2500}).write_csv(path)
    actuator = thesis.model_copy(update={"reading": Reading(**reading)})
    text = refusal(lambda: read_recordings(path, actuator))
    assert "'current_A' is empty in all rows that are used" in text
    path.write_text("time_s,command_rad,current_A\n")
    assert "no rows" in refusal(lambda: read_recordings(path, thesis, split="stretches"))


@pytest.mark.parametrize("split", ["stretches", "rests"])
def test_times_that_do_not_increase_are_named_where_they_leave_no_piece(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal, split: str
) -> None:
    for times in (columns["time_s"][::-1], np.round(columns["time_s"], 3)):
        path = save(columns | {"time_s": times}, tmp_path)
        text = refusal(partial(read_recordings, path, thesis, split=split))
        assert "time does not increase at row 2 of column 'time_s'" in text


def test_a_rest_is_found_by_the_rows_that_have_a_value() -> None:
    rng, rows = np.random.default_rng(5), 11
    for _ in range(100):
        command = np.repeat(rng.normal(size=20), rng.integers(1, 30, 20))
        command[rng.integers(0, command.size, 2)] = np.nan
        expected = np.zeros(command.size, bool)
        for first in range(command.size - rows + 1):
            known = command[first : first + rows][~np.isnan(command[first : first + rows])]
            if not known.size or np.ptp(known) == 0:
                expected[first : first + rows] = True
        found = at_rest(np.arange(command.size) / 1e3, command, (rows - 1) / 1e3)
        np.testing.assert_array_equal(found, expected)
