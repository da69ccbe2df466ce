"""Sensor noise and analogue-digital converters, compared with their textbook statistics."""

import numpy as np
import pytest
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.recording import Recording, acquire, full_scales

from .conftest import Columns, Refusal

ROWS = 40_000


@pytest.fixture
def long() -> Recording:
    time = np.arange(ROWS) / 5000.0
    wave = np.random.default_rng(5).uniform(-9, 9, ROWS)
    names = ("command_rad", "current_A", "current_a_A", "position_rad")
    return Recording({"time_s": time, **dict.fromkeys(names, wave)}, "instant", "rig 3")


def _disturbance(recording: Recording, name: str, noisy: Recording) -> NDArray[np.float64]:
    return np.asarray(noisy[name] - recording[name])


def test_noise_is_white_gaussian_with_the_requested_rms(long: Recording) -> None:
    noise = _disturbance(long, "current_A", acquire(long, noise={"current_A": 0.3}, seed=1))
    # Four standard errors of each statistic of 40,000 normal draws.
    assert noise.mean() == pytest.approx(0, abs=4 * 0.3 / ROWS**0.5)
    assert noise.std() == pytest.approx(0.3, rel=4 / (2 * ROWS) ** 0.5)
    assert np.mean(noise**4) == pytest.approx(3 * 0.3**4, rel=4 * (96 / 9 / ROWS) ** 0.5)
    assert np.mean(noise[1:] * noise[:-1]) / 0.09 == pytest.approx(0, abs=4 / ROWS**0.5)


def test_only_the_same_seed_gives_the_same_bits(long: Recording) -> None:
    first, repeated, another_seed = (acquire(long, noise={"current_A": 0.3}, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first["current_A"], repeated["current_A"])
    assert not np.any(first["current_A"] == another_seed["current_A"])


def test_noise_of_a_channel_does_not_depend_on_other_channels(long: Recording) -> None:
    alone = acquire(long, noise={"position_rad": 0.1}, seed=1)
    among = acquire(long, noise={"current_A": 1.0, "current_a_A": 1.0, "position_rad": 0.1}, seed=1)
    fewer = Recording({name: long[name] for name in long if name != "current_a_A"})
    bare = acquire(fewer, noise={"position_rad": 0.1}, seed=1)
    np.testing.assert_array_equal(alone["position_rad"], among["position_rad"])
    np.testing.assert_array_equal(alone["position_rad"], bare["position_rad"])


def test_noise_differs_between_channels(long: Recording) -> None:
    noisy = acquire(long, noise={"current_A": 1.0, "current_a_A": 1.0}, seed=1)
    one, two = (_disturbance(long, name, noisy) for name in ("current_A", "current_a_A"))
    assert np.corrcoef(one, two)[0, 1] == pytest.approx(0, abs=4 / ROWS**0.5)


@pytest.mark.parametrize("bits", [4, 8, 12])
def test_quantisation_error_has_the_variance_of_a_uniform_step(long: Recording, bits: int) -> None:
    # The range exceeds the signal's ±9 by one step, so that no value is clipped.
    full_scale = 12.0
    error = _disturbance(
        long, "current_A", acquire(long, adc_bits=bits, full_scale={"current_A": 12.0}, seed=0)
    )
    step = 2 * full_scale / 2**bits
    assert np.abs(error).max() <= step / 2 * (1 + 1e-9)
    # The square of a uniform variable scatters by 0.894 of its mean: four standard errors.
    assert error.var() == pytest.approx(step**2 / 12, rel=4 * 0.894 / ROWS**0.5)


def test_a_converter_is_mid_tread_and_clips(long: Recording) -> None:
    measured = acquire(long, adc_bits=4, full_scale={"current_A": 4.0}, seed=0)["current_A"]
    np.testing.assert_array_equal(np.unique(measured), np.arange(-8, 8) * 0.5)
    np.testing.assert_array_equal(measured[np.abs(long["current_A"]) < 0.24], 0.0)
    assert measured[long["current_A"].argmax()] == 3.5
    assert measured[long["current_A"].argmin()] == -4.0


def test_time_command_and_the_original_recording_are_unchanged(long: Recording, thesis: Actuator) -> None:
    original = {name: long[name].copy() for name in long}
    noisy = acquire(long, noise={"current_A": 1.0}, adc_bits=8, full_scale=full_scales(thesis), seed=0)
    for name in long:
        np.testing.assert_array_equal(long[name], original[name])
    for name in ("time_s", "command_rad"):
        np.testing.assert_array_equal(noisy[name], original[name])
    assert (noisy.sampling, noisy.source, noisy.names) == ("instant", "rig 3", long.names)


def test_without_noise_or_converter_nothing_changes(long: Recording) -> None:
    acquired = acquire(long, seed=0)
    for name in long:
        np.testing.assert_array_equal(acquired[name], long[name])


def test_full_scales_have_a_margin_above_the_limits(thesis: Actuator, emps: Actuator) -> None:
    scales = full_scales(thesis)
    assert scales["current_b_A"] == pytest.approx(45.0)
    assert scales["position_rad"] == pytest.approx(1.2 * 0.5236)
    assert scales["angle_rad"] == pytest.approx(1.2 * 0.5236 * 500)
    assert scales["speed_rad_s"] == pytest.approx(1.2 * 8000 / 60 * 2 * np.pi)
    assert scales["voltage_V"] == pytest.approx(57.6)
    assert scales["load_Nm"] == pytest.approx(2 * 1.689)
    # Without end stops, speed or torque limits, the ranges of these sensors are unknown.
    assert set(full_scales(emps)) == {
        "current_a_A",
        "current_b_A",
        "current_c_A",
        "current_A",
        "current_d_A",
        "current_q_A",
        "temperature_K",
    }


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"noise": {"current_A": -0.1}}, ["current_A=-0.1", "0 or more"]),
        ({"noise": {"current_A": np.nan}}, ["current_A=nan", "0 or more"]),
        ({"noise": {"voltag": 0.1}}, ["'voltag'", "'voltage_V'"]),
        ({"noise": {"command_rad": 0.1}}, ["'command_rad'", "leave it out"]),
        ({"noise": {"voltage_V": 0.1}}, ["rig 3", "'voltage_V'", "leave that noise out"]),
        ({"adc_bits": 3, "full_scale": {"current_A": 1.0}}, ["3 bits", "4 to 24"]),
        ({"adc_bits": 25, "full_scale": {"current_A": 1.0}}, ["25 bits", "4 to 24"]),
        ({"adc_bits": 12}, ["adc_bits", "give full_scale"]),
        ({"adc_bits": 12, "full_scale": {"current_A": 0.0}}, ["current_A=0", "more than 0"]),
        ({"adc_bits": 12, "full_scale": {"speed": 1.0}}, ["'speed'", "'speed_rad_s'"]),
        ({"full_scale": {"time_s": 1.0}}, ["'time_s'", "leave it out"]),
    ],
)
def test_impossible_sensors_are_refused(
    long: Recording, refusal: Refusal, arguments: dict[str, object], expected: list[str]
) -> None:
    text = refusal(lambda: acquire(long, seed=0, **arguments))  # type: ignore[arg-type]
    for part in expected:
        assert part in text


def test_sensors_with_default_ranges_do_not_clip_a_healthy_recording(
    columns: Columns, thesis: Actuator
) -> None:
    recording = Recording(columns)
    measured = acquire(recording, adc_bits=16, full_scale=full_scales(thesis), seed=0)
    # 16 bits over ±45 A: half a step is 0.7 mA.
    np.testing.assert_allclose(measured["current_A"], recording["current_A"], atol=45 / 2**16)
    np.testing.assert_allclose(measured["temperature_K"], recording["temperature_K"], atol=500 / 2**16)
