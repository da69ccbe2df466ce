"""A load as a spline over the run, against another library and against a load as a function of time."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from emaphm.actuator import Chirp, Faults
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, REFERENCE, Model
from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.running import observe_batch
from emaphm.simulation.laws.load_variation import (
    FEWEST,
    MORE_THAN_INTERVALS,
    MOST,
    coefficient_names,
    coefficients_for,
    spline_basis,
)
from simulation.rig import THESIS, altered

DURATION = 0.1
CURRENT_LOOP = {"current_gain": 1.0, "current_integral_gain": 500.0, "pwm_frequency": 2e4}


def spline_of(coefficients: Array, duration: float = 1.0) -> BSpline:
    """Return the cubic spline of another library with uniform knots over the duration."""
    intervals = len(coefficients) - 3
    knots = np.arange(-3, intervals + 4) * duration / intervals
    return BSpline(knots, coefficients, 3)


@given(
    coefficients=st.lists(st.floats(-1.0, 1.0), min_size=7, max_size=35),
    shares=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20),
)
def test_the_spline_basis_agrees_with_another_library(coefficients: list[float], shares: list[float]) -> None:
    basis = spline_basis(len(coefficients), np.array(shares))
    expected = spline_of(np.array(coefficients))(np.array(shares))
    np.testing.assert_allclose(basis @ coefficients, expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(basis.sum(axis=1), 1.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("duration", "intervals"), [(0.01, 4), (0.25, 4), (0.5, 8), (1.0, 16), (20.0, 32)])
def test_intervals_are_a_sixteenth_of_a_second_within_bounds(duration: float, intervals: int) -> None:
    assert coefficients_for(duration) - MORE_THAN_INTERVALS == intervals
    assert FEWEST <= intervals <= MOST


def observed(model: Model, actuator: Any, faults: Array, load: Any, coefficients: Array | None) -> Array:
    inputs = Inputs.of(Chirp(), load, samples=500, interval=DURATION / 500, step=model.step)
    varying = {} if coefficients is None else dict(zip(coefficient_names(7), coefficients, strict=True))
    return observe_batch(model, Plant.of(actuator, faults, varying), inputs, workers=1)


@pytest.mark.parametrize(
    ("model", "drive"),
    [(AVERAGED, "hysteresis"), (REFERENCE, "hysteresis"), (REFERENCE, "six-step"), (AVERAGED, "foc")],
)
def test_a_load_by_coefficients_acts_like_the_same_load_by_time(model: Model, drive: str) -> None:
    # Enough lanes for two groups, each with its load.
    loads = np.random.default_rng(5).uniform(-0.2, 0.2, (7, 17))
    faults = np.tile(Faults(friction=0.2).vector, (17, 1))
    actuator = THESIS if drive == "hysteresis" else altered(drive={"kind": drive, **CURRENT_LOOP})
    signals = observed(model, actuator, faults, 0.05, loads)
    for lane in (0, 16):
        spline = spline_of(loads[:, lane], DURATION)
        expected = observed(model, actuator, faults[:1], lambda t, s=spline: 0.05 + s(t), None)[0]
        # Only rounding, except where it decides on a switching.
        scale = np.abs(expected).max(axis=1, keepdims=True)
        np.testing.assert_allclose(signals[lane] / scale, expected / scale, rtol=0, atol=1e-6)
