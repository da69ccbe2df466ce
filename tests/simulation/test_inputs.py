"""Steps and samples: times at which inputs are read, and rows formed from steps."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.actuator import Chirp, Faults, Ramp, Sampled, Sine
from emaphm.errors import SignalError
from emaphm.simulation import AVERAGED, MODELS, REFERENCE, Initial, Inputs, Model
from simulation.rig import INTERVAL, record

EACH_MODEL = pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))


@given(interval=st.floats(1e-5, 1e-2), longest=st.floats(1e-6, 1e-2), samples=st.integers(1, 5))
def test_the_step_is_the_largest_that_divides_the_interval(
    interval: float, longest: float, samples: int
) -> None:
    inputs = Inputs.of(Ramp(1.0), 3.0, samples=samples, interval=interval, step=longest)
    assert inputs.step * inputs.substeps == pytest.approx(interval, rel=1e-15)
    assert inputs.step <= longest * (1 + 2e-9)
    if inputs.substeps > 1:
        assert interval / (inputs.substeps - 1) > longest * (1 - 1e-9)
    assert inputs.command.shape == inputs.load.shape == (samples * inputs.substeps,)
    # A ramp of rate 1 has the times of its evaluation as values: the starts of the steps.
    np.testing.assert_allclose(inputs.command, np.arange(inputs.command.size) * inputs.step, rtol=1e-14)
    np.testing.assert_allclose(inputs.time_s, np.arange(samples) * interval, rtol=1e-15)
    assert set(inputs.load) == {3.0}


@pytest.mark.parametrize("sampling", ["instants", "Mean", ""])
def test_an_unknown_sampling_is_refused(sampling: Any) -> None:
    with pytest.raises(SignalError, match=f"unknown sampling '{sampling}'"):
        Inputs.of(Ramp(), samples=3, interval=1e-3, step=1e-3, sampling=sampling)


@pytest.mark.parametrize(
    ("interval", "step", "substeps"), [(2e-4, 1e-6, 200), (2e-4, 5e-5, 4), (1e-3, 7e-4, 2)]
)
def test_the_number_of_steps_is_not_affected_by_rounding(interval: float, step: float, substeps: int) -> None:
    # 2e-4 / 1e-6 is 199.99999999999997 in binary, and 2e-4 / 5e-5 exactly 4.
    assert Inputs.of(Ramp(), samples=3, interval=interval, step=step).substeps == substeps


def test_a_load_may_be_a_number_or_a_signal() -> None:
    options: dict[str, Any] = {"samples": 4, "interval": 0.5, "step": 0.25}
    assert set(Inputs.of(Ramp(), 2, **options).load) == {2.0}
    ramp = Inputs.of(Ramp(), Sampled([0, 2], [0, 4]), **options).load
    np.testing.assert_allclose(ramp, np.arange(8) * 0.5)


MOTION = ("position_rad", "speed_rad_s", "angle_rad")


@EACH_MODEL
def test_a_row_is_the_mean_of_its_steps_or_the_first_of_them(model: Model) -> None:
    options: dict[str, Any] = {"duration": 0.02, "start": Initial(rotor_offset=0.3)}
    steps = record(model, Sine(8e-3, 15.0), interval=model.step, **options)
    means = record(model, Sine(8e-3, 15.0), **options)
    instants = record(model, Sine(8e-3, 15.0), sampling="instant", **options)
    per_row = round(INTERVAL / model.step)
    for name in set(steps) - {"time_s"}:
        by_row = steps[name].reshape(-1, per_row)
        largest = np.abs(by_row).max()
        # Rounding of a sum of 200 values; the sum over the steps of a run does not depend on its rows.
        np.testing.assert_allclose(
            means[name], by_row.mean(axis=1), rtol=0, atol=1e-11 * largest, err_msg=name
        )
        # At an instant, the motion is that at the end of the previous step; it starts from rest at 0.
        first = by_row[:, 0]
        if name in MOTION:
            first = np.concatenate([[0.0], steps[name][per_row - 1 : -1 : per_row]])
        np.testing.assert_allclose(instants[name], first, rtol=0, atol=1e-11 * largest, err_msg=name)


@EACH_MODEL
@pytest.mark.parametrize(
    "steps_a_row",
    [
        1,
        2,
        4,
    ],
)
def test_the_instant_at_time_0_is_the_initial_state(model: Model, steps_a_row: int) -> None:
    signals = record(
        model,
        Sine(8e-3, 15.0),
        duration=8 * model.step,
        interval=steps_a_row * model.step,
        step=model.step,
        sampling="instant",
        start=Initial(angle=1.0, speed=40.0),
    )
    assert [signals[name][0] for name in MOTION] == [1.0 / 500, 40.0, 1.0]


@EACH_MODEL
def test_rows_at_another_rate_are_means_of_the_same_run(model: Model) -> None:
    fine = record(model, Chirp(), duration=0.1, interval=1e-4)
    coarse = record(model, Chirp(), duration=0.1, interval=4e-4)
    for name in ("current_A", "position_rad", "voltage_V"):
        pooled = fine[name].reshape(-1, 4).mean(axis=1)
        # Times of steps differ in rounding by 1e-17 s, which is negligible before a leg switches.
        np.testing.assert_allclose(
            coarse[name], pooled, rtol=0, atol=1e-9 * np.abs(pooled).max(), err_msg=name
        )


def test_the_rotor_offset_affects_only_the_phases() -> None:
    plain = record(AVERAGED, Chirp(), duration=0.2)
    turned = record(AVERAGED, Chirp(), duration=0.2, start=Initial(rotor_offset=1.0))
    # A healthy averaged motor does not depend on the angle; the three phases of the reference model do.
    np.testing.assert_allclose(turned["current_A"], plain["current_A"], rtol=0, atol=1e-9)
    phases = [
        record(REFERENCE, Chirp(), duration=0.02, start=Initial(rotor_offset=offset))["current_a_A"]
        for offset in (0.0, 1.0)
    ]
    assert np.abs(phases[0] - phases[1]).max() > 0.5


def test_a_start_away_from_zero_is_a_shifted_run() -> None:
    angle = 2 * np.pi * 7
    shift = angle / 500
    chirp = Chirp()
    plain = record(AVERAGED, chirp, duration=0.2)
    shifted = record(AVERAGED, lambda t: chirp(t) + shift, duration=0.2, start=Initial(angle=angle))
    # Positions near 0.09 rad are resolved to 1e-17 rad, which the gain of 1e5 × 0.66 A amplifies to 1e-12 A.
    np.testing.assert_allclose(shifted["current_A"], plain["current_A"], rtol=0, atol=1e-8)
    np.testing.assert_allclose(shifted["position_rad"], plain["position_rad"] + shift, rtol=0, atol=1e-13)
    np.testing.assert_allclose(shifted["angle_rad"], plain["angle_rad"] + angle, rtol=0, atol=1e-10)


@EACH_MODEL
def test_the_rotor_angle_is_the_initial_angle_plus_the_offset(model: Model) -> None:
    # With shorts and eccentricity the rotor angle has an effect; the command is shifted like the start.
    faults = Faults(short_a=0.5, eccentricity=0.8, eccentricity_phase=0.3)
    command, angle = Sine(8e-3, 15.0), 1.0
    options: dict[str, Any] = {"faults": faults, "duration": 0.01}
    by_offset = record(model, command, start=Initial(rotor_offset=angle), **options)
    by_angle = record(model, lambda t: command(t) + angle / 500, start=Initial(angle=angle), **options)
    unturned = record(model, command, **options)
    # The shifted position differs by a rounding of 2e-3 rad, which the gains amplify to some 1e-12 A.
    np.testing.assert_allclose(by_angle["current_A"], by_offset["current_A"], rtol=0, atol=1e-8)
    assert np.abs(unturned["current_A"] - by_offset["current_A"]).max() > 0.02
