"""Pulse-width modulation: voltage-time areas of legs, lengths of periods, and the delay of a controller."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.pulse_width import (
    carrier_after,
    centred,
    delay_shares,
    delayed,
    leg_mean,
    triangle,
)


@given(duty=st.floats(-1, 1), half=st.integers(2, 100))
def test_a_leg_has_the_voltage_time_area_of_its_duty(duty: float, half: int) -> None:
    # The carrier reverses at the end of a step if half a period is a whole number of steps.
    per_period = 1 / (2 * half)
    phases = np.arange(2 * half) * per_period
    legs = leg_mean(duty, triangle(phases, per_period), per_period)
    assert legs.mean() == pytest.approx(duty, abs=1e-12)
    # High about the middle of the period, where the carrier is low; low about its ends; two steps in between.
    assert np.sum(np.abs(legs) < 1 - 1e-9) <= 2
    np.testing.assert_allclose(legs, legs[::-1], atol=1e-9)


def test_periods_have_no_cumulative_error() -> None:
    for frequency, step in ((2e4, 1e-6), (13e3, 1e-6), (4.1e4, 5e-7)):
        per_period, phase, starts = frequency * step, 0.0, []
        for n in range(50_000):
            if phase < 0.5 * per_period:
                starts.append(n)
            phase = float(carrier_after(phase, per_period))
        # Each period begins at the step nearest to its true start.
        np.testing.assert_allclose(
            np.array(starts) * step * frequency, np.arange(len(starts)), atol=0.51 * per_period
        )


@given(angle=st.floats(-7, 7), amplitude=st.floats(0, 2 / 3**0.5))
def test_centred_duty_cycles_allow_an_amplitude_larger_by_15_percent(angle: float, amplitude: float) -> None:
    duties = amplitude * np.sin(angle - 2 * np.pi / 3 * np.arange(3))
    moved = np.array([*centred(Phases(*duties))])
    assert np.abs(moved).max() <= 1 + 1e-12
    np.testing.assert_allclose(moved - moved.mean(), duties, atol=1e-12)


@pytest.mark.parametrize("periods", [0.2, 0.5, 1.0, 2.0, 7.0])
def test_the_averaged_controller_has_the_mean_delay_of_sampling_and_pwm(periods: float) -> None:
    step = 5e-5
    share, at_once = (float(x[0]) for x in delay_shares(np.array([1 / (periods * step)]), step))
    # The area between a step of the demand and the applied value is the mean delay.
    state, area = 0.0, 0.0
    for _ in range(2000):
        applied, state = delayed(state, 1.0, share, at_once)
        area += (1 - applied) * step
    expected = max(
        1.5 * periods * step, step / 2
    )  # at least half a step, the delay of any model with this step
    assert area + step / 2 == pytest.approx(expected, rel=1e-9)
    if periods == 1:
        assert (share, at_once) == (1, 0)
