"""The controller: effects of its gains and limits on recorded channels, and its noise."""

import math

import numpy as np
import pytest

from emaphm.actuator import Chirp, Faults, Ramp, Step
from emaphm.simulation import AVERAGED, MODELS, REFERENCE, Model
from simulation.rig import FREE, LOCKED, altered, record

EACH_MODEL = pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))
WIDE = {"current_limit": 1e9, "speed_limit": None}


@EACH_MODEL
@pytest.mark.parametrize("k8", [0.0, 0.5, 1.0])
def test_the_demand_at_a_locked_shaft_is_the_gains_times_the_error(model: Model, k8: float) -> None:
    actuator = altered(
        mechanics=LOCKED, controller=WIDE | {"integral_gain": 3.0}, motor={"torque_constant": 1e-6}
    )
    amplitude = 1e-4
    signals = record(
        model, Step(amplitude), actuator, faults=Faults(gain=k8), duration=2e-3, interval=model.step
    )
    error = (0.5 + k8) * 1e5 * amplitude
    expected = (5e-2 * error + 3.0 * error * signals["time_s"]) / 0.0752
    np.testing.assert_allclose(signals["reference_current_A"], expected, rtol=1e-10)  # sums of 2000 terms


@EACH_MODEL
def test_the_derivative_gain_acts_on_the_slope_of_the_error(model: Model) -> None:
    rate, derivative = 1e-3, 1e-3
    actuator = altered(
        mechanics=LOCKED, controller=WIDE | {"derivative_gain": derivative}, motor={"torque_constant": 1e-6}
    )
    signals = record(model, Ramp(rate), actuator, duration=2e-3, interval=model.step)
    error = 1e5 * rate * signals["time_s"]
    expected = (5e-2 * error + derivative * 1e5 * rate) / 0.0752
    # The first step has no slope. Rounding of a difference of errors up to 0.2, divided by a step of 1e-6.
    np.testing.assert_allclose(signals["reference_current_A"][1:], expected[1:], rtol=1e-8)
    assert signals["reference_current_A"][0] == 0


@EACH_MODEL
@pytest.mark.parametrize("sign", [1, -1])
def test_speed_demand_and_current_demand_are_limited(model: Model, sign: int) -> None:
    held = {"mechanics": LOCKED, "motor": {"torque_constant": 1e-6}}
    unlimited = record(
        model, Step(sign * 0.1), altered(**held, controller={"current_limit": 1e9}), duration=1e-3
    )
    demand = 5e-2 * 8000 / 60 * math.tau / 0.0752
    assert unlimited["reference_current_A"][0] == pytest.approx(sign * demand, rel=1e-12)
    limited = record(model, Step(sign * 0.1), altered(**held), duration=1e-3)
    assert limited["reference_current_A"].tolist() == [sign * 22.5] * 5


@EACH_MODEL
def test_the_drive_uses_its_assumed_torque_constant(model: Model) -> None:
    # The constant of the motor may differ, by shorts or calibration, from that assumed by the drive.
    actuator = altered(
        mechanics=LOCKED, controller=WIDE | {"torque_constant": 0.1}, motor={"torque_constant": 0.02}
    )
    signals = record(model, Step(1e-4), actuator, duration=2e-4)
    assert signals["reference_current_A"][0] == pytest.approx(5e-2 * 10 / 0.1, rel=1e-12)


@EACH_MODEL
def test_the_torque_is_limited(model: Model) -> None:
    actuator = altered(motor={"torque_limit": 0.5})
    signals = record(model, Step(1e-2), actuator, duration=0.02, interval=model.step)
    assert signals["torque_Nm"].max() == 0.5
    assert 0.0752 * signals["current_A"].max() > 0.6


@EACH_MODEL
@pytest.mark.parametrize("lag", [0.0, 2e-3])
def test_the_speed_feedback_has_a_first_order_lag(model: Model, lag: float) -> None:
    # A load accelerates a shaft without friction uniformly; the torque of the motor is negligible.
    actuator = altered(
        mechanics=FREE,
        controller=WIDE | {"position_gain": 1e-12, "speed_lag": lag},
        motor={"torque_constant": 1e-9},
    )
    acceleration = 0.05 / 2.5e-5
    signals = record(model, Step(0.0), actuator, load=-0.05, duration=0.02, sampling="instant")
    t = signals["time_s"]
    late = lag * -np.expm1(-t / lag) if lag else 0.0
    # The filter takes a ramp as steps, with an error of half a step, at most 50 us.
    expected = -5e-2 * acceleration * (t - late) / 0.0752
    bound = 5e-2 * acceleration * model.step / 0.0752
    np.testing.assert_allclose(signals["reference_current_A"], expected, rtol=1e-6, atol=bound)


@pytest.mark.parametrize("lag", [0.0, 2e-3])
def test_torque_follows_an_ideal_current_through_a_first_order_lag(lag: float) -> None:
    actuator = altered(mechanics=LOCKED, motor={"torque_lag": lag, "torque_limit": None}, electrical=None)
    signals = record(AVERAGED, Step(1.0), actuator, duration=0.01, interval=5e-5)
    assert set(signals["current_A"]) == {22.5}
    risen = -np.expm1(-(signals["time_s"] + 5e-5) / lag) if lag else 1.0
    np.testing.assert_allclose(signals["torque_Nm"], 0.0752 * 22.5 * risen, rtol=1e-12)  # sums of 200 steps


NOISE_A = 0.3


def noisy(seed: int, model: Model = REFERENCE) -> dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    return record(
        model,
        Step(0.0),
        altered(mechanics=LOCKED),
        duration=0.02,
        interval=model.step,
        noise=NOISE_A,
        seed=seed,
    )


def test_the_seed_determines_the_noise() -> None:
    first, same, other = (noisy(seed)["reference_current_A"] for seed in (7, 7, 8))
    assert np.array_equal(first, same)
    assert np.abs(np.corrcoef(first, other)[0, 1]) < 5 / math.sqrt(first.size)


def test_noise_is_white_and_has_the_requested_rms() -> None:
    added = noisy(7)["reference_current_A"]
    n = added.size
    assert np.std(added) == pytest.approx(NOISE_A, rel=5 / math.sqrt(2 * n))  # five standard errors
    assert np.mean(added) == pytest.approx(0, abs=5 * NOISE_A / math.sqrt(n))
    assert np.corrcoef(added[1:], added[:-1])[0, 1] == pytest.approx(0, abs=5 / math.sqrt(n))


def test_noise_is_off_by_default_and_changes_the_current_if_on() -> None:
    quiet = record(REFERENCE, Chirp(), duration=0.05)["current_A"]
    silent = record(REFERENCE, Chirp(), duration=0.05, noise=0.0, seed=3)["current_A"]
    loud = record(REFERENCE, Chirp(), duration=0.05, noise=NOISE_A, seed=3)["current_A"]
    assert np.array_equal(quiet, silent)
    assert not np.array_equal(quiet, loud)


@pytest.mark.parametrize("model", [AVERAGED, MODELS["monitor"]], ids=["averaged", "monitor"])
def test_monitor_and_averaged_models_have_no_noise(model: Model) -> None:
    # Thesis 3.2.1: the white noise block is absent from the monitor model.
    assert not noisy(7, model)["reference_current_A"].any()
