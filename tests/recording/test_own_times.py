"""Columns with their own times are resampled at the times of the command."""

from typing import Any

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.actuator.channels import Channels
from emaphm.actuator.reading import Reading
from emaphm.arrays import Array
from emaphm.recording import Recording, recordings_of
from emaphm.recording.io.file_columns import FileColumns

from .conftest import Refusal

TIME = np.arange(2000) / 1000.0
FAST = {"command_rad": 5e-3 * np.sin(20 * TIME), "current_A": 0.5 * np.cos(20 * TIME)}
SAMPLING = ("mean", "instant")


def logged(late: dict[str, tuple[Array, Array]]) -> FileColumns:
    """Return command and current at 1 kHz for 2 s, and columns with their own times: (times, values)."""
    numeric = FAST | {name: values for name, (_, values) in late.items()}
    times = dict.fromkeys(FAST, TIME) | {name: own for name, (own, _) in late.items()}
    return FileColumns(numeric, {}, times=times)


def read(columns: FileColumns, thesis: Actuator, sampling: str, keep: str | None = None) -> Recording:
    channels = Channels.model_validate({"sampling": sampling})
    actuator = thesis.model_copy(update={"channels": channels, "reading": Reading(keep=keep)})
    (recording,) = recordings_of(columns, "log", actuator)
    return recording


@pytest.mark.parametrize("sampling", SAMPLING)
def test_a_state_written_only_at_changes_holds_until_the_next_change(thesis: Actuator, sampling: str) -> None:
    on = (np.array([0.0, 0.5, 1.5]), np.array([0.0, 1.0, 0.0]))
    expected = (TIME >= 0.5) & (TIME < 1.5)
    recording = read(logged({"enabled": on}), thesis, sampling)
    np.testing.assert_array_equal(recording["enabled"], expected)
    kept = read(logged({"mode": on}), thesis, sampling, "mode == 1")
    np.testing.assert_array_equal(kept["time_s"], TIME[expected])


@pytest.mark.parametrize("sampling", SAMPLING)
def test_a_state_written_once_holds_for_the_recording(thesis: Actuator, sampling: str) -> None:
    recording = read(logged({"enabled": (np.array([0.0]), np.array([1.0]))}), thesis, sampling)
    assert recording.samples == TIME.size
    assert np.all(recording["enabled"] == 1)


@pytest.mark.parametrize("sampling", SAMPLING)
def test_rows_outside_the_times_of_a_column_are_left_out(thesis: Actuator, sampling: str) -> None:
    current = (TIME[10:-20], FAST["current_A"][10:-20])
    state = (np.array([0.03, 1.0]), np.array([1.0, 2.0]))
    recording = read(logged({"current_A": current, "enabled": state}), thesis, sampling)
    np.testing.assert_array_equal(recording["time_s"], TIME[30:-20])
    np.testing.assert_allclose(recording["current_A"], FAST["current_A"][30:-20], atol=1e-12)
    assert (
        "the first 30 rows and the last 20 rows left out, which the times of current_A, enabled do not cover"
        in recording.notes
    )


def test_instants_end_with_the_last_row_of_a_slow_column(thesis: Actuator) -> None:
    slow = np.arange(20) / 10.0
    recording = read(logged({"temperature_K": (slow, 293.0 + slow)}), thesis, "instant")
    np.testing.assert_array_equal(recording["time_s"], TIME[:1901])
    np.testing.assert_allclose(recording["temperature_K"], 293.0 + TIME[:1901])


@pytest.mark.parametrize("sampling", SAMPLING)
def test_columns_with_times_that_do_not_overlap_are_refused(
    thesis: Actuator, refusal: Refusal, sampling: str
) -> None:
    columns = logged({"current_A": (TIME + 100.0, FAST["current_A"])})
    assert "the times of current_A do not overlap" in refusal(lambda: read(columns, thesis, sampling))


@pytest.mark.parametrize("sampling", SAMPLING)
def test_a_command_without_rows_is_refused(thesis: Actuator, refusal: Refusal, sampling: str) -> None:
    nothing = (TIME[:0], TIME[:0])
    assert "too short: 0 rows" in refusal(lambda: read(logged({"command_rad": nothing}), thesis, sampling))


def test_a_column_of_times_takes_precedence_over_the_times_of_the_format(thesis: Actuator) -> None:
    # By the format, all columns of the group have a row each second; the other group also counts from 0.
    own, shown = np.arange(2000.0), TIME + 5.0
    slow = np.arange(-1.0, 2001.0, 4.0)
    numeric = {f"Drive/{name}": values for name, values in (FAST | {"time_s": shown}).items()}
    times = dict.fromkeys(("Drive/command_rad", "Drive/current_A"), own) | {"Slow/temperature_K": slow}
    columns = FileColumns(numeric | {"Slow/temperature_K": 293.0 + slow}, {}, times=times)
    recording = read(columns, thesis, "instant")
    np.testing.assert_array_equal(recording["time_s"], shown)
    np.testing.assert_array_equal(recording["current_A"], FAST["current_A"])
    np.testing.assert_allclose(recording["temperature_K"], 293.0 + own, atol=1e-6)


@pytest.mark.parametrize(("rows", "reading"), [(4000, {}), (1000, {}), (4000, {"dwell_s": 0.1})])
def test_a_column_of_another_length_is_refused_before_rows_are_selected(
    thesis: Actuator, refusal: Refusal, rows: int, reading: dict[str, Any]
) -> None:
    times = np.delete(TIME, 1500)  # a lost row is interpolated in columns of equal length only
    numeric = {"time_s": times, "command_rad": np.resize(FAST["command_rad"], rows), "current_A": times}
    actuator = thesis.model_copy(update={"reading": Reading(**reading)})
    text = refusal(lambda: recordings_of(FileColumns(numeric, {}), "log", actuator))
    assert f"'command_rad' has {rows} rows, 'time_s' has 1999" in text


def test_times_of_other_columns_than_those_read_are_no_time_base(thesis: Actuator, refusal: Refusal) -> None:
    columns = FileColumns(FAST | {"other": TIME}, {}, times={"other": TIME})
    assert "no column 'time_s', and the file has no times" in refusal(lambda: read(columns, thesis, "mean"))
