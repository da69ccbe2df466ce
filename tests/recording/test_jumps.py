"""Reconstruction of the time of a jump from recorded rows; smooth signals and noise are no jumps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cases import THESIS
from emaphm.actuator import Chirp, Command, Faults
from emaphm.arrays import Array
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.recording import Recording, reconstructed
from emaphm.recording.jumps import Jumps, with_jumps
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED, Plant, observe_batch

ROWS, INTERVAL, POINTS = 200, 2e-4, 400


def means_of(command: Command) -> Recording:
    """Return the means of a command over the intervals."""
    times = (np.arange(ROWS * POINTS) + 0.5) * INTERVAL / POINTS
    rows = command(times).reshape(ROWS, POINTS).mean(axis=1)
    columns = {"time_s": np.arange(ROWS) * INTERVAL, "command_rad": rows, "current_A": np.zeros(ROWS)}
    return Recording(columns, sampling="mean")


def sine(times: Array) -> Array:
    return np.asarray(np.sin(2 * np.pi * 25.0 * times))


@given(at=st.floats(0.1, 0.9), size=st.floats(0.7, 3.0), sign=st.sampled_from([-1.0, 1.0]))
def test_the_time_of_a_jump_follows_from_the_mean_of_its_row(at: float, size: float, sign: float) -> None:
    moment = at * ROWS * INTERVAL
    curve = reconstructed(
        means_of(lambda times: sine(times) + sign * size * (times >= moment)), "command_rad"
    )
    # The means are sums over points, so the jump is located to one point; the sine is curved near it.
    apart = 0.02 * INTERVAL
    times = np.array([moment - 3 * INTERVAL, moment - apart, moment + apart, moment + 3 * INTERVAL])
    expected = sine(times) + sign * size * np.array([0.0, 0.0, 1.0, 1.0])
    np.testing.assert_allclose(curve(times), expected, atol=5e-3)


def test_a_staircase_is_held_between_its_jumps() -> None:
    held = np.repeat(np.random.default_rng(0).normal(size=ROWS // 10), 10)
    columns = {"time_s": np.arange(ROWS) * INTERVAL, "command_rad": held, "current_A": np.zeros(ROWS)}
    times = (np.arange(ROWS * 7) + 0.5) / 7 * INTERVAL
    for sampling in ("mean", "instant"):
        curve = reconstructed(Recording(columns, sampling=sampling), "command_rad")
        np.testing.assert_allclose(curve(times)[:-7], np.repeat(held, 7)[:-7], atol=1e-12)
        backwards = curve(times[::-1])[::-1]
        np.testing.assert_array_equal(backwards, curve(times))


@pytest.mark.parametrize("means", [True, False])
def test_smooth_signals_and_noise_do_not_jump(means: bool) -> None:
    rng = np.random.default_rng(1)
    times = np.asarray(np.arange(5000) * INTERVAL, float)
    walk = np.asarray(np.cumsum(rng.normal(size=5000)), float)
    for values in (
        Chirp(duration=1.0)(times),
        rng.normal(size=200_000),
        walk,
        np.zeros(50),
        times,
        np.ones(2),
    ):
        assert Jumps.of(values, means=means).before.size == 0


def test_a_jump_between_curves_that_agree_is_accepted() -> None:
    values = np.repeat([0.0, 1.0], 20)
    curve = with_jumps(values, 1e-3, lambda *_: lambda times: np.zeros(times.size), means=True)
    assert np.array_equal(curve(np.linspace(0.0, 0.039, 40)), np.zeros(40))


def test_a_reconstructed_square_wave_drives_the_model_like_the_original() -> None:
    def square(times: Array) -> Array:
        return np.where(np.sin(2 * np.pi * 8.0 * (times + 1e-9)) >= 0, 5e-3, -5e-3)

    recording = simulate(THESIS, square, model="averaged", duration=0.3)
    inputs = DrivingSignals.of(recording, THESIS).inputs(AVERAGED.step_for(THESIS))
    plant = Plant.of(THESIS, Faults().vector[np.newaxis])
    modelled = observe_batch(AVERAGED, plant, inputs, channels=("current_A",))[0, 0]
    error = float(np.sqrt(np.mean((modelled - recording["current_A"]) ** 2)))
    assert error < 1e-3 * float(np.sqrt(np.mean(recording["current_A"] ** 2)))
