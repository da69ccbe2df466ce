"""A back-EMF other than a trapezoid with flats of 120 degrees: closed forms, and agreement of both models."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.actuator import Actuator, Chirp, Step
from emaphm.arrays import Array
from emaphm.errors import ActuatorError
from emaphm.simulation import AVERAGED, REFERENCE, Initial, Model
from emaphm.simulation.laws.commutation import trapezoid
from emaphm.simulation.laws.emf_shape import emf_shape
from simulation.rig import LOCKED, THESIS, altered, record, rms

K = 0.0752
NARROW = {"flat_loss": math.radians(30)}
SINE = {"sine_share": 1.0}
ANGLES = np.radians(np.arange(-180.0, 180.0, 0.5))


def shaped(angle: Array, flat_loss: float, sine_share: float) -> Array:
    return np.asarray(emf_shape(angle, flat_loss, sine_share))


@given(flat_loss=st.floats(0.0, math.pi / 3), sine_share=st.floats(0.0, 1.0))
def test_the_torque_constant_is_the_amplitude_line_to_line(flat_loss: float, sine_share: float) -> None:
    shape = shaped(ANGLES, flat_loss, sine_share)
    between = shape - np.roll(shape, 240)  # phase b is 120 degrees behind
    # The sine is approximated by a polynomial.
    assert between.max() == pytest.approx(2.0, abs=1e-7)
    assert between[np.radians(60.0) == ANGLES] == pytest.approx([2.0], abs=1e-7)
    # Half-wave symmetry: the second half repeats the first with the opposite sign.
    assert shape == pytest.approx(-np.roll(shape, 360), abs=1e-12)


def test_a_sine_share_of_1_is_a_sine() -> None:
    np.testing.assert_allclose(shaped(ANGLES, 0.3, 1.0), 2 / 3**0.5 * np.sin(ANGLES), rtol=0, atol=1e-7)


def test_without_loss_and_sine_share_the_shape_is_the_trapezoid() -> None:
    assert np.array_equal(shaped(ANGLES, 0.0, 0.0), trapezoid(ANGLES))


@pytest.mark.parametrize(
    ("model", "bound"), [(AVERAGED, 1e-4), (REFERENCE, 0.01)], ids=["averaged", "reference"]
)
@pytest.mark.parametrize(
    ("motor", "beyond_centre", "factor"),
    [
        (SINE, 0.0, 1.0),
        (SINE, 20.0, math.cos(math.radians(20))),
        (SINE, -25.0, math.cos(math.radians(25))),
        (NARROW, 10.0, 1.0),
        # 5 degrees before commutation, where the outgoing phase is at 35 of the 45 degrees of its ramp.
        (NARROW, 25.0, (1 + 35 / 45) / 2),
        (NARROW | {"sine_share": 0.5}, 25.0, (1 + 35 / 45) / 4 + math.cos(math.radians(25)) / 2),
    ],
)
def test_a_stalled_motor_has_the_torque_by_the_shapes_at_its_angle(
    model: Model, bound: float, motor: dict[str, float], beyond_centre: float, factor: float
) -> None:
    electrical = 60.0 + beyond_centre  # a and b conduct from 30 to 90 degrees
    start = Initial(rotor_offset=math.radians(electrical) / 2)
    actuator = altered(
        motor=motor | {"torque_limit": None}, mechanics=LOCKED, controller={"current_limit": 10.0}
    )
    signals = record(model, Step(0.1), actuator, duration=0.02, start=start, interval=1e-3)
    assert signals["torque_Nm"][-1] == pytest.approx(K * factor * signals["current_A"][-1], rel=bound)
    assert abs(signals["current_A"][-1]) == pytest.approx(10.0, abs=0.6)


@pytest.mark.parametrize("drive", [{}, {"drive": {"kind": "six-step"}}], ids=["hysteresis", "six-step"])
@pytest.mark.parametrize("motor", [SINE, NARROW], ids=["sine", "narrow"])
def test_the_shape_has_the_same_effect_in_both_models(motor: dict[str, float], drive: dict[str, Any]) -> None:
    base = Actuator.pmsm() if drive else THESIS

    def currents(actuator: Actuator) -> Array:
        runs = [record(model, Chirp(), actuator, duration=0.3) for model in (AVERAGED, REFERENCE)]
        return np.array([signals["current_A"] for signals in runs])

    without = currents(altered(base, **drive))
    with_shape = currents(altered(base, motor=motor, **drive))
    of_averaged, of_reference = with_shape - without
    assert rms(of_averaged) > 0.02 * rms(without[1])
    assert rms(of_averaged - of_reference) < 0.3 * rms(of_reference) + rms(without[0] - without[1])
    assert rms(with_shape[0] - with_shape[1]) < 1.2 * rms(without[0] - without[1])


@pytest.mark.parametrize("key", ["flat_loss", "sine_share"])
def test_a_shape_is_refused_for_a_motor_with_sinusoidal_back_emf(key: str) -> None:
    with pytest.raises(
        ActuatorError,
        match=f"'motor.{key}': the motor of a drive of kind \"foc\" has no trapezoidal back-EMF",
    ):
        altered(Actuator.pmsm(), motor={key: 0.2})
