"""Torque ripple: harmonics by products, and energy exchanged with a coasting shaft."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.simulation import AVERAGED, REFERENCE, Initial, Model
from emaphm.simulation.laws.cogging import harmonic, ripple_torque
from simulation.rig import FREE, altered, record

INERTIA = 2.5e-5
DRIFTING: dict[str, Any] = {
    "mechanics": FREE,
    "controller": {"position_gain": 1e-12, "speed_gain": 1e-12, "speed_limit": None},
    "motor": {"torque_constant": 1e-9},
}


@given(order=st.integers(1, 200), angle=st.floats(-math.pi, math.pi))
def test_harmonics_agree_with_trigonometric_functions(order: int, angle: float) -> None:
    cos, sin = harmonic(order)(math.cos(angle), math.sin(angle))
    # Rounding grows with the order, by one addition of angles for each doubling.
    assert cos == pytest.approx(math.cos(order * angle), abs=1e-15 * (10 + order))
    assert sin == pytest.approx(math.sin(order * angle), abs=1e-15 * (10 + order))


@given(order=st.integers(1, 200))
def test_the_error_of_a_direction_grows_with_the_power_of_its_order(order: int) -> None:
    cos, sin = harmonic(order)(1.001, 0.0)
    assert (cos, sin) == (pytest.approx(1.001**order, rel=1e-12), 0.0)


def test_ripple_is_the_sum_of_cosine_and_sine() -> None:
    assert float(ripple_torque(0.6, 0.8, 2.0, 3.0)) == pytest.approx(0.6 * 2 + 0.8 * 3)


@pytest.mark.parametrize("model", [AVERAGED, REFERENCE], ids=["averaged", "reference"])
def test_a_coasting_shaft_exchanges_energy_with_the_ripple(model: Model) -> None:
    """J w²/2 changes by the work of A cos nθ + B sin nθ, with the angle θ of motor or screw."""
    screw_ratio, offset, w = 0.4, 0.3, 60.0
    ripple = [
        {"order": 6, "of": "motor", "cos": 2e-3, "sin": -1e-3},
        {"order": 3, "of": "screw", "cos": 1e-3, "sin": 3e-3},
    ]
    drifting = DRIFTING | {"mechanics": FREE | {"screw_ratio": screw_ratio}}
    base = altered(**drifting)
    actuator = type(base).from_dict(base.model_dump() | {"ripple": ripple})

    def work(theta: Any) -> Any:
        total = 0.0
        for harmonic_term, n in ((ripple[0], 6.0), (ripple[1], 3.0 * screw_ratio)):
            total = (
                total
                + (
                    float(str(harmonic_term["cos"])) * np.sin(n * theta)
                    - float(str(harmonic_term["sin"])) * np.cos(n * theta)
                )
                / n
            )
        return total

    errors = []
    for step in (model.step, model.step / 4):
        signals = record(
            model,
            lambda t: 0 * t,
            actuator,
            duration=0.2,
            interval=5e-4,
            step=step,
            start=Initial(speed=w, rotor_offset=offset),
            sampling="instant",
        )
        rotor = signals["angle_rad"] + offset
        expected = np.sqrt(w**2 + 2 / INERTIA * (work(rotor) - work(offset)))
        assert np.ptp(expected) > 0.2
        errors.append(np.abs(signals["speed_rad_s"] - expected).max() / np.ptp(expected))
    # The ripple is half a step early: n w Δt / 2 = 0.9 % at 50 µs.
    assert errors[0] < 0.015
    assert errors[1] < 0.3 * errors[0]


def test_the_torque_of_the_motor_balances_the_ripple_at_constant_speed() -> None:
    """With a stiff speed loop, the torque of the motor is the negative ripple."""
    base = altered(
        mechanics=FREE | {"backlash": 0.0},
        controller={"position_gain": 1e-9, "speed_feedforward": 1.0, "speed_gain": 0.05, "speed_limit": None},
        motor={"torque_limit": None},
    )
    ripple = [{"order": 4, "cos": 5e-3, "sin": 2e-3}]
    actuator = type(base).from_dict(base.model_dump() | {"ripple": ripple})
    speed = 20.0
    signals = record(
        AVERAGED, lambda t: speed * t / 500, actuator, duration=0.4, interval=5e-4, start=Initial(speed=speed)
    )
    angle, torque = signals["angle_rad"][400:], signals["torque_Nm"][400:]
    # The residual of the loop is accelerating torque: a delay of J n w / GAP = 4 %.
    expected = -(5e-3 * np.cos(4 * angle) + 2e-3 * np.sin(4 * angle))
    assert np.abs(torque - expected).max() < 0.06 * 5.4e-3
