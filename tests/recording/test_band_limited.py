"""Interpolation of few rows per cycle: compared with sines in closed form, and no ringing at a jump."""

import numpy as np
import pytest

from emaphm.recording import Recording
from emaphm.recording.band_limited import is_band_limited
from emaphm.recording.reconstruction import reconstructed

ROWS = 200


def of_sine(rows_a_cycle: float, sampling: str) -> tuple[Recording, float]:
    """Return rows of sin(w t) 0.1 s apart (instants or means in closed form), and w."""
    interval = 0.1
    w = 2 * np.pi / (rows_a_cycle * interval)
    start = np.arange(ROWS) * interval
    values = np.sin(w * start)
    if sampling == "mean":
        values = (np.cos(w * start) - np.cos(w * (start + interval))) / (w * interval)
    columns = {"time_s": start, "command_rad": values, "current_A": values}
    return Recording(columns, sampling), w  # type: ignore[arg-type]


@pytest.mark.parametrize("sampling", ["mean", "instant"])
@pytest.mark.parametrize(
    ("rows_a_cycle", "error"),
    # The spline's error of a sine of w h is about 2 (w h / 2 pi)^6; ten times as much at the ends.
    [(5.0, 2e-3), (6.7, 3e-4), (10.0, 3e-5), (20.0, 1e-6)],
)
def test_a_sine_is_interpolated_between_its_rows(rows_a_cycle: float, error: float, sampling: str) -> None:
    recording, w = of_sine(rows_a_cycle, sampling)
    assert is_band_limited(recording["command_rad"])
    inner = np.linspace(0.1, 0.9, 5000) * recording.duration_s
    off = reconstructed(recording, "command_rad")(inner) - np.sin(w * inner)
    assert np.max(np.abs(off)) < error


@pytest.mark.parametrize("rows_a_cycle", [5.0, 12.0])
def test_the_means_of_the_curve_over_the_intervals_equal_the_rows(rows_a_cycle: float) -> None:
    recording, _ = of_sine(rows_a_cycle, "mean")
    curve = reconstructed(recording, "command_rad")
    fine = (np.arange(400) + 0.5) / 400 * recording.interval_s
    times = recording["time_s"][:, np.newaxis] + fine
    means = curve(times.ravel()).reshape(times.shape).mean(axis=1)
    # The error of the midpoint rule over 400 points, not of the curve.
    np.testing.assert_allclose(means, recording["command_rad"], rtol=0, atol=1e-5)


def test_a_straight_line_is_interpolated_exactly() -> None:
    values = 3.0 + 0.5 * np.arange(60.0)
    assert not is_band_limited(values)


@pytest.mark.parametrize("kind", ["jump", "bends", "noise", "well sampled"])
def test_signals_unsuited_to_a_spline_keep_the_curve_that_does_not_ring(kind: str) -> None:
    t = np.arange(ROWS) / ROWS
    values = {
        "jump": np.where(t > 0.5, 1.0, 0.0),
        "bends": np.abs(((4 * t) % 2) - 1),
        "noise": np.random.default_rng(0).normal(size=ROWS),
        "well sampled": np.sin(2 * np.pi * 5 * t),
    }[kind]
    assert not is_band_limited(values)
    columns = {"time_s": t, "command_rad": values, "current_A": values}
    between = reconstructed(Recording(columns, "instant"), "command_rad")(np.linspace(0, 0.99, 5000))
    if kind in ("jump", "bends"):
        assert between.min() >= -1e-9
        assert between.max() <= 1 + 1e-9


@pytest.mark.parametrize("sampling", ["mean", "instant"])
def test_a_jump_in_the_first_row_or_the_last_does_not_ring(sampling: str) -> None:
    time = np.arange(2000) * 2e-4
    smooth = 3e-3 * np.sin(2 * np.pi * 16 * np.maximum(time - 0.15, 0.0) ** 2)
    for row in (1, time.size - 1):
        values = smooth + 4e-3 * (np.arange(time.size) >= row)
        recording = Recording({"time_s": time, "command_rad": values, "current_A": values}, sampling)  # type: ignore[arg-type]
        curve = reconstructed(recording, "command_rad")(np.linspace(0.0, 0.4, 40001))
        assert curve.min() >= values.min() - 1e-6
        assert curve.max() <= values.max() + 1e-6


@pytest.mark.parametrize("within", [0.0, 0.3, 0.5, 0.8])
@pytest.mark.parametrize("sampling", ["mean", "instant"])
def test_a_bend_anywhere_within_a_row_does_not_ring(within: float, sampling: str) -> None:
    # A sine that begins after a rest; each mean is over 100 instants.
    fine = np.arange(100 * 2000) / 100 - 6 - within
    instants = np.where(fine > 0, np.sin(0.02 * fine), 0.0)
    values = instants.reshape(-1, 100).mean(axis=1) if sampling == "mean" else instants[::100]
    assert not is_band_limited(values)
    columns = {"time_s": np.arange(2000) * 1.0, "command_rad": values, "current_A": values}
    curve = reconstructed(Recording(columns, sampling), "command_rad")  # type: ignore[arg-type]
    # In the row of the bend, no curve can be exact; before it, the command is constant.
    np.testing.assert_allclose(curve(np.linspace(0.0, 4.0, 50)), 0.0, atol=1e-5)


@pytest.mark.parametrize("rows_a_cycle", [4.5, 6.0, 8.0, 16.0, 27.0])
def test_no_part_of_a_smooth_burst_is_a_bend(rows_a_cycle: float) -> None:
    rows = np.arange(ROWS)
    for phase in np.linspace(0, 2 * np.pi, 40):
        burst = np.exp(-(((rows - 100) / 20) ** 2)) * np.sin(2 * np.pi * rows / rows_a_cycle + phase)
        assert is_band_limited(burst)
