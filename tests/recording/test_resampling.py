"""Rows with time jitter are resampled at a constant rate, with a note."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.actuator import Actuator
from emaphm.actuator.channels import Channels
from emaphm.arrays import Array
from emaphm.recording import Recording, acquire, read_recording
from emaphm.recording.resampling import on_uniform_grid

from .conftest import Columns

ROWS = 1000
INTERVAL = 1e-3


def jittered(largest: float, seed: int = 0) -> Array:
    """Return time stamps with errors up to `largest`, as a fraction of the interval."""
    moves = np.random.default_rng(seed).uniform(-largest, largest, ROWS)
    return np.asarray(INTERVAL * (np.arange(ROWS) + moves))


def swing(t: Array) -> Array:
    """Return a sine of 15 Hz, the highest frequency commanded in the thesis."""
    return np.asarray(5e-3 * np.sin(2 * np.pi * 15 * t))


def means(signal: Callable[[Array], Array], edges: Array) -> Array:
    """Return the means of a signal between `edges` (n + 1,), by Gauss's rule."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    middles, halves = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
    return np.asarray(signal(middles[:, np.newaxis] + halves[:, np.newaxis] * nodes) @ weights / 2)


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("largest", [0.05, 0.2])
def test_instants_are_resampled_accurately(largest: float) -> None:
    time = jittered(largest)
    recording = Recording({"time_s": time, "command_rad": swing(time), "current_A": time}, "instant")
    grid = recording["time_s"]
    np.testing.assert_allclose(grid, np.linspace(time[0], time[-1], ROWS), rtol=0, atol=1e-12)
    # A straight line has the error h²x''/8 midway between two rows: 1.1e-3 of the amplitude. If the rows are
    # taken as uniform, the error is jitter times speed: 94 rad/s × 1 ms × 0.2 / sqrt(3), 1 % of the rms.
    error = recording["command_rad"] - swing(grid)
    assert rms(error) < 2e-4 * rms(swing(grid))
    naive = swing(time) - swing(np.asarray(INTERVAL * np.arange(ROWS)))
    assert rms(error) < 0.05 * rms(naive)
    np.testing.assert_allclose(recording["current_A"], grid, rtol=0, atol=1e-12)


@pytest.mark.parametrize("largest", [0.05, 0.2])
def test_means_are_resampled_accurately_and_keep_their_integral(largest: float) -> None:
    time = jittered(largest)
    edges = np.append(time, time[-1] + np.diff(time).mean())
    rows = means(swing, edges)
    recording = Recording({"time_s": time, "command_rad": rows, "current_A": rows}, "mean")
    grid = np.append(recording["time_s"], edges[-1])
    exact = means(swing, grid)
    assert rms(recording["command_rad"] - exact) < 2e-3 * rms(exact)
    integral = float(rows @ np.diff(edges))
    assert recording["command_rad"].sum() * recording.interval_s == pytest.approx(integral, abs=1e-15)


@given(seed=st.integers(0, 1000), height=st.floats(-10, 10), row=st.integers(10, ROWS - 10))
def test_a_jump_has_little_overshoot(seed: int, height: float, row: int) -> None:
    time = jittered(0.1, seed)
    jump = np.where(np.arange(ROWS) < row, 0.0, height)
    recording = Recording({"time_s": time, "command_rad": 1 + time, "current_A": jump}, "instant")
    beyond = np.maximum(recording["current_A"] * np.sign(height) - abs(height), 0.0)
    assert beyond.max() <= 1e-9 * abs(height)
    far = np.abs(np.arange(ROWS) - row) > 3
    np.testing.assert_allclose(recording["current_A"][far], jump[far], rtol=0, atol=1e-9)


def test_switch_states_and_missing_values_are_kept() -> None:
    time = jittered(0.1)
    enabled = (time < 0.5).astype(float)
    holes = np.where(np.arange(ROWS) % 7 == 0, np.nan, 1.0)
    given = {
        "time_s": time,
        "command_rad": 1 + time,
        "current_A": time,
        "enabled": enabled,
        "humidity": holes,
    }
    recording = Recording(given, "instant")
    assert set(recording["enabled"]) == {0.0, 1.0}
    assert abs(recording["enabled"].sum() - enabled.sum()) <= 1
    assert np.isnan(recording["humidity"]).sum() == pytest.approx(np.isnan(holes).sum(), abs=5)


def test_an_angle_may_be_wrapped_at_each_turn() -> None:
    time = jittered(0.1)
    angle = np.angle(np.exp(1j * 300 * time))
    recording = Recording(
        {"time_s": time, "command_rad": 1 + time, "current_A": time, "angle_rad": angle}, "instant"
    )
    off = np.angle(np.exp(1j * (recording["angle_rad"] - 300 * recording["time_s"])))
    assert np.abs(off).max() < 1e-9


def test_a_note_states_the_resampling_and_is_kept() -> None:
    time = jittered(0.05)
    recording = Recording({"time_s": time, "command_rad": swing(time), "current_A": time}, source="rig 3")
    (note,) = recording.notes
    worst = np.abs(np.diff(time) / np.diff(recording["time_s"]).mean() - 1).argmax() + 2
    for piece in ("0.001", "% rms", f"at row {worst}", "resampled to 1000", "Hz"):
        assert piece in note
    assert note in repr(recording)
    assert acquire(recording, noise={"current_A": 0.1}, seed=0).notes == (note,)


def test_uniform_rows_stay_bit_for_bit(columns: Columns) -> None:
    recording = Recording(columns)
    assert recording.notes == ()
    for name, values in columns.items():
        np.testing.assert_array_equal(recording[name], values)


def test_logs_of_a_real_servo_are_read(xl330_folder: Path, thesis: Actuator) -> None:
    names = Channels(
        sampling="instant",
        command_rad="goal_rad",
        position_rad="position_rad",
        enabled="torque_enable",
        temperature_K="temperature_degC",
    )
    rig = thesis.model_copy(update={"channels": names})
    files = sorted(xl330_folder.glob("*.csv"))
    assert len(files) >= 8
    for file in files:
        recording = read_recording(file, rig)
        table = pl.read_csv(file)
        time, position = table["time_s"].to_numpy(), table["position_rad"].to_numpy()
        assert len(recording.notes) == 1
        assert recording.samples == time.size
        assert set(recording["enabled"]) <= {0.0, 1.0}
        # The encoder's step is 2 pi / 4096: the curve stays as near to the chords between the rows.
        chords = np.interp(recording["time_s"], time, position)
        assert np.abs(recording["position_rad"] - chords).max() < 2 * 2 * np.pi / 4096


def test_a_clock_with_a_small_change_of_rate_is_resampled() -> None:
    # Each step is within a percent; the last rows of the first half deviate by 56 rows from uniform times.
    steps = np.repeat([1e-3, 1.009e-3], 12_500)
    time = np.concatenate([[0.0], np.cumsum(steps)])
    columns = {"time_s": time, "command_rad": np.sin(2 * np.pi * 0.7 * time)}
    uniform, (note,) = on_uniform_grid(columns, "instant")
    assert "resampled" in note
    np.testing.assert_allclose(np.diff(uniform["time_s"]), 1.0045e-3, rtol=1e-6)
    np.testing.assert_allclose(uniform["command_rad"], np.sin(2 * np.pi * 0.7 * uniform["time_s"]), atol=1e-6)
