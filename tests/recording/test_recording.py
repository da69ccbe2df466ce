"""The value object `Recording`: its guarantees about columns, its text form and its plot."""

import copy
import pickle
from typing import Any

import numpy as np
import pytest

from emaphm.recording import Recording

from .conftest import Columns, Refusal


def test_the_time_base_follows_from_the_sampling(columns: Columns) -> None:
    recording = Recording(columns)
    assert recording.samples == 2500
    assert recording.interval_s == pytest.approx(2e-4, rel=1e-12)
    assert recording.sample_rate_hz == pytest.approx(5000.0, rel=1e-12)
    # Each row stands for an interval, so the interval of the last row counts.
    assert recording.duration_s == pytest.approx(0.5, rel=1e-12)


def test_later_changes_of_the_input_do_not_change_the_recording(columns: Columns) -> None:
    recording = Recording(columns)
    columns["current_A"][0] = 1e9
    assert recording["current_A"][0] != 1e9


def test_columns_and_mapping_are_read_only(columns: Columns) -> None:
    recording = Recording(columns)
    with pytest.raises(ValueError, match="read-only"):
        recording["current_A"][0] = 0.0
    with pytest.raises(TypeError):
        recording.channels["current_A"] = columns["time_s"]  # type: ignore[index]


def test_integer_columns_become_floats(columns: Columns) -> None:
    recording = Recording({**columns, "temperature_K": np.full(2500, 293, dtype=np.int16)})
    assert recording["temperature_K"].dtype == np.float64


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda r: pickle.loads(pickle.dumps(r))])  # noqa: S301 - pickled by this test
def test_copies_are_equal_and_read_only(columns: Columns, duplicate: type) -> None:
    recording = Recording(columns, "instant", "rig 3", ("cut at 3 s",))
    copy_ = duplicate(recording)
    assert (copy_.sampling, copy_.source, copy_.names) == ("instant", "rig 3", recording.names)
    assert copy_.notes == ("cut at 3 s",)
    for name in recording:
        np.testing.assert_array_equal(copy_[name], recording[name])
        assert not copy_[name].flags.writeable


def test_columns_beyond_the_schema_are_kept(columns: Columns) -> None:
    torque = np.linspace(0, 1, 2500)
    recording = Recording({**columns, "torque_Nm": torque})
    assert "torque_Nm" in recording
    np.testing.assert_array_equal(recording["torque_Nm"], torque)


def test_an_unknown_column_is_refused_with_the_nearest_name(columns: Columns, refusal: Refusal) -> None:
    text = refusal(lambda: Recording(columns, source="rig 3")["position_rd"])
    assert "rig 3" in text
    assert "'position_rad'" in text


def test_a_text_column_is_refused(columns: Columns, refusal: Refusal) -> None:
    text = refusal(lambda: Recording({**columns, "current_A": ["much"] * 2500}))
    assert "'current_A'" in text
    assert "not numeric" in text


@pytest.mark.parametrize(
    ("sampling", "hint"),
    [("instants", "'instant'"), ("Instant", "'instant'"), ("foo", "mean"), (None, "mean")],
)
def test_an_unknown_sampling_is_refused_with_the_nearest_name(
    columns: Columns, refusal: Refusal, sampling: Any, hint: str
) -> None:
    text = refusal(lambda: Recording(columns, sampling, "rig 3"))
    assert f"rig 3: unknown sampling '{sampling}'" in text
    assert hint in text


def test_a_single_text_is_one_note(columns: Columns) -> None:
    recording = Recording(columns, notes="cut at 3 s")
    assert recording.notes == ("cut at 3 s",)
    assert recording.with_channels(columns, "filtered").notes == ("cut at 3 s", "filtered")


def test_a_plot_without_columns_is_refused(columns: Columns, refusal: Refusal) -> None:
    assert "no columns to draw" in refusal(lambda: Recording(columns).plot([]))


def test_a_masked_value_is_missing(columns: Columns, refusal: Refusal) -> None:
    masked = np.ma.masked_array(columns["current_A"], mask=np.arange(2500) == 41)
    text = refusal(lambda: Recording({**columns, "current_A": masked}))
    assert "row 42 of column 'current_A' is empty or not a finite number" in text
    counts = np.ma.masked_array(np.arange(2500), mask=np.arange(2500) == 41)
    kept = Recording({**columns, "counts": counts})["counts"]
    assert np.flatnonzero(np.isnan(kept)).tolist() == [41]


@pytest.mark.parametrize("unit", ["us", "ns"])
def test_time_differences_become_seconds(columns: Columns, unit: str) -> None:
    time = (np.arange(2500) * 200).astype("timedelta64[us]").astype(f"timedelta64[{unit}]")
    recording = Recording({**columns, "time_s": time})
    assert recording.sample_rate_hz == pytest.approx(5000.0, rel=1e-12)


def test_dates_are_refused_with_the_remedy(columns: Columns, refusal: Refusal) -> None:
    time = np.datetime64("2026-11-28T06:00") + (np.arange(2500) * 200).astype("timedelta64[us]")
    text = refusal(lambda: Recording({**columns, "time_s": time}))
    assert "column 'time_s' is of dates; give seconds" in text
    assert Recording({**columns, "time_s": (time - time[0]) / np.timedelta64(1, "s")}).samples == 2500


def test_complex_numbers_are_refused(columns: Columns, refusal: Refusal) -> None:
    text = refusal(lambda: Recording({**columns, "current_A": columns["current_A"] + 1j}))
    assert "column 'current_A' is complex; give real numbers" in text


def test_the_frame_holds_all_columns(columns: Columns) -> None:
    frame = Recording(columns).to_frame()
    assert tuple(frame.columns) == tuple(columns)
    np.testing.assert_array_equal(frame["current_A"].to_numpy(), columns["current_A"])


def test_the_repr_has_source_size_rate_and_ranges(columns: Columns) -> None:
    text = repr(Recording(columns, source="rig 3"))
    assert "rig 3" in text
    assert "2500 rows (interval means) at 5000 Hz, 0.5 s" in text
    assert "-0.005 to 0.005" in text


def test_the_plot_stacks_the_named_columns_over_a_shared_time_axis(columns: Columns) -> None:
    figure = Recording(columns).plot(["current_A", "position_rad"])
    upper, lower = figure.axes
    assert [axis.get_ylabel() for axis in figure.axes] == [
        "equivalent current\n[A]",
        "position of the user\n[rad]",
    ]
    np.testing.assert_array_equal(upper.lines[0].get_ydata(), columns["current_A"])
    lower.set_xlim(0.1, 0.2)
    assert upper.get_xlim() == (0.1, 0.2)


def test_the_plot_of_a_linear_actuator_shows_metres_and_all_columns(columns: Columns) -> None:
    figure = Recording({**columns, "torque_Nm": columns["current_A"]}).plot(coordinates="linear")
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert labels[:3] == ["command\n[m]", "position of the user\n[m]", "speed of the motor\n[m/s]"]
    assert labels[-1] == "torque_Nm"
