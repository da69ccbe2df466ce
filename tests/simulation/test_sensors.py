"""Sensors outside the control loop, against linear system theory."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.actuator.sensors import IDEAL, Sensor
from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.simulation.laws.sensors import (
    delayed,
    lagged,
    rounded,
    sensed,
    with_static_errors,
    without_static_errors,
)

INTERVAL = 1e-3
ROWS = 400
TIME: Array = np.asarray(np.arange(ROWS) * INTERVAL)
OMEGA = 2 * np.pi * 15
FINE = 64
"""Number of points per interval for means by the trapezoidal rule."""

CUBIC = 3 / 128 * (OMEGA * INTERVAL) ** 4
"""Largest error of a cubic through four rows of a sine, midway between the inner two."""


def swing(t: Any) -> Any:
    """Return a sine with a smooth start from rest."""
    return np.sin(OMEGA * t) * (1 - np.exp(-20 * t)) ** 3


FINE_TIMES: Array = np.linspace(0, TIME[-1] + INTERVAL, ROWS * FINE + 1)


def true_lag(lag: float) -> Array:
    """Return the exact response to `swing` at `FINE_TIMES`, from rest.

    The sine is a sum of exponentials exp(s t), with responses (exp(s t) - exp(-t/T)) / (1 + s T) for a lag T.
    """
    rates = -20.0 * np.arange(4) + 1j * OMEGA
    own = np.exp(-FINE_TIMES / lag)
    parts = [(np.exp(s * FINE_TIMES) - own) / (1 + s * lag) for s in rates]
    return np.asarray(np.imag(np.array([1, -3, 3, -1]) @ np.array(parts)))


def means(fine: Array) -> Array:
    """Return interval means of values at `FINE` points per interval and one at the end."""
    middles = (fine[1:] + fine[:-1]) / 2
    return np.asarray(middles.reshape(-1, FINE).mean(axis=1))


@pytest.mark.parametrize("lag", [1e-4, 1e-3, 2e-2])
@pytest.mark.parametrize("sampling", ["instant", "mean"])
def test_a_lag_agrees_with_its_differential_equation(lag: float, sampling: str) -> None:
    true, response = swing(FINE_TIMES), true_lag(lag)
    given, expected = (
        (means(true), means(response)) if sampling == "mean" else (true[:-1:FINE], response[:-1:FINE])
    )
    # The last row has no next row and is extrapolated by a parabola.
    response_rows = lagged(given, INTERVAL, lag)[:-1]
    assert np.abs(response_rows - expected[:-1]).max() < 1.5 * CUBIC


@given(lag=st.floats(0, 100.0), level=st.floats(-1e3, 1e3, allow_subnormal=False))
def test_a_constant_is_unchanged_by_lag_and_delay(lag: float, level: float) -> None:
    constant = np.full(50, level)
    np.testing.assert_allclose(lagged(constant, INTERVAL, lag), constant, rtol=1e-9)
    np.testing.assert_allclose(delayed(constant, INTERVAL, lag), constant, rtol=1e-12)


@given(lag=st.floats(1e-4, 5e-3), slope=st.floats(-10, 10))
def test_a_lag_delays_a_ramp_by_its_time_constant(lag: float, slope: float) -> None:
    lagged_ramp = lagged(slope * TIME, INTERVAL, lag)
    settled = 30 * lag < TIME
    np.testing.assert_allclose(lagged_ramp[settled], slope * (TIME - lag)[settled], rtol=0, atol=1e-10)


@pytest.mark.parametrize("delay", [1e-4, 1e-3, 2.5e-3, 0.0203])
def test_a_delay_shifts_the_signal(delay: float) -> None:
    expected = np.where(delay <= TIME, swing(np.maximum(TIME - delay, 0)), 0.0)
    assert np.abs(delayed(swing(TIME), INTERVAL, delay) - expected)[:-1].max() < 1.5 * CUBIC + 1e-7


@given(rows=st.integers(0, 30), seed=st.integers(0, 100))
def test_a_delay_of_whole_rows_is_exact(rows: int, seed: int) -> None:
    signal = np.random.default_rng(seed).normal(size=60)
    delayed_signal = delayed(signal, INTERVAL, rows * INTERVAL)
    np.testing.assert_allclose(delayed_signal[rows:], signal[: 60 - rows], rtol=0, atol=1e-9)
    np.testing.assert_allclose(delayed_signal[:rows], signal[0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_lag_and_delay_of_few_rows_are_those_of_the_longer_signal(rows: int) -> None:
    signal = np.cumsum(np.random.default_rng(rows).normal(size=10))
    shift = 1.0 * INTERVAL  # a delay of one row needs no row behind
    np.testing.assert_allclose(
        delayed(signal[:rows], INTERVAL, shift), delayed(signal, INTERVAL, shift)[:rows], rtol=1e-12
    )
    # A lag integrates up to a row with the row behind it, which is extrapolated for the last one.
    np.testing.assert_allclose(
        lagged(signal[:rows], INTERVAL, 2e-3)[: rows - 1], lagged(signal, INTERVAL, 2e-3)[: rows - 1]
    )


def test_each_signal_may_have_its_lag_or_delay() -> None:
    several = np.stack([swing(TIME), TIME, np.cos(OMEGA * TIME)])
    times = np.array([0.0, 2e-4, 3.3e-3])
    for law in (lagged, delayed):
        batch = law(several, INTERVAL, times)
        for row, signal, time in zip(batch, several, times, strict=True):
            np.testing.assert_allclose(row, law(signal, INTERVAL, time), rtol=0, atol=1e-8)


@given(scale=st.floats(-0.9, 3), offset=st.floats(-10, 10), value=st.floats(-1e3, 1e3))
def test_static_errors_are_inverted(scale: float, offset: float, value: float) -> None:
    values = np.array([value])
    shown = with_static_errors(values, scale, offset)
    assert shown[0] == pytest.approx((1 + scale) * value + offset)
    assert without_static_errors(shown, scale, offset)[0] == pytest.approx(value, abs=1e-9)


@given(resolution=st.floats(1e-4, 1), value=st.floats(-50, 50))
def test_rounding_is_to_the_nearest_count(resolution: float, value: float) -> None:
    shown = float(rounded(np.array([value]), resolution)[0])
    assert abs(shown - value) <= resolution / 2 * (1 + 1e-9)
    assert shown / resolution == pytest.approx(round(shown / resolution), abs=1e-6)
    assert rounded(np.array([value]), 0.0)[0] == value


def test_sensor_errors_are_applied_in_the_order_of_a_measurement() -> None:
    sensor = Sensor(lag=2e-3, delay=1e-3, scale=0.1, offset=-0.3, unsigned=True)
    late = delayed(lagged(swing(TIME), INTERVAL, 2e-3), INTERVAL, 1e-3)
    np.testing.assert_allclose(sensed(swing(TIME), sensor, INTERVAL, 0.05), np.abs(1.1 * late - 0.3 + 0.05))
    signal = swing(TIME)
    assert sensed(signal, IDEAL, INTERVAL) is signal


def test_a_delay_as_long_as_the_signal_is_refused() -> None:
    with pytest.raises(MethodError, match=r"delay of 1 s .* 0\.4 s; correct it under \[sensors\]"):
        sensed(TIME, Sensor(delay=1.0), INTERVAL)
