"""The optional laws of friction: each against its closed form, and runs against solve_ivp."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from emaphm.actuator import Actuator, Sine
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, REFERENCE, Initial, Model
from emaphm.simulation.laws.exponential import decaying_exponential
from emaphm.simulation.laws.friction import directional, dry_level
from emaphm.simulation.laws.load_friction import transmitted_friction
from emaphm.simulation.laws.standstill import saturation, speed_against, speed_through_standstill
from emaphm.simulation.laws.stribeck import stribeck_factor
from simulation.rig import FREE, altered, record, rms

SPEEDS = st.floats(-1e4, 1e4)
RATIOS = st.floats(1e-6, 1e4)


@given(exponent=st.floats(0.0, 1e6))
def test_the_exponential_has_an_error_below_4e_6(exponent: float) -> None:
    assert float(decaying_exponential(exponent)) == pytest.approx(math.exp(-exponent), rel=0, abs=4e-6)


def test_the_exponential_is_1_at_rest_positive_and_decreasing() -> None:
    exponents = np.linspace(0.0, 40.0, 400_001)
    values = decaying_exponential(np.append(exponents, 1e300))
    assert values[0] == 1.0
    assert np.all(values > 0.0)
    assert np.all(np.diff(values) <= 0.0)
    assert np.max(np.abs(values[:-1] - np.exp(-exponents))) < 4e-6


@given(speed=SPEEDS, stribeck=st.floats(1e-3, 1e3))
def test_the_stribeck_curve_is_gaussian(speed: float, stribeck: float) -> None:
    expected = math.exp(-((speed / stribeck) ** 2))
    assert float(stribeck_factor(speed, 1 / stribeck)) == pytest.approx(expected, rel=0, abs=4e-6)


def test_dry_friction_is_static_at_rest_and_dynamic_at_speed() -> None:
    at_rest, fast = (dry_level(0.2, 0.08, 0.01, 0.03, stribeck_factor(w, 1 / 5.0)) for w in (0.0, 50.0))
    assert float(at_rest) == pytest.approx(0.2 + 0.01 + 0.03, rel=1e-12)
    assert float(fast) == pytest.approx(0.08 + 0.01, abs=1e-6)


def test_the_smooth_sign_is_close_to_tanh() -> None:
    x = np.linspace(0.0, 20.0, 200_001)
    sign = saturation(x, 0.0)
    assert np.max(np.abs(sign - np.tanh(x))) < 5e-3
    assert sign[0] == 0.0
    assert np.all(np.diff(sign) >= -1e-15)
    np.testing.assert_allclose(sign[x > 4.0], 1.0, rtol=1e-15)
    slope = np.diff(sign) / np.diff(x)
    assert slope[0] == pytest.approx(1.0, abs=1e-4)
    assert np.max(np.abs(np.diff(slope))) < 2e-4  # steps of 1e-4: no kink, and a second derivative below 2


@given(free=SPEEDS, braking=st.just(0.0) | RATIOS, transition=st.floats(1e-3, 1e3))
def test_the_step_through_standstill_solves_its_implicit_equation(
    free: float, braking: float, transition: float
) -> None:
    after = float(speed_through_standstill(free, braking, 1 / transition))
    friction = braking * float(saturation(abs(after) / transition, 0.0))
    # Rounding of a quadratic equation whose coefficients have ratios up to (1e4 / 1e-3)².
    assert abs(after) + friction == pytest.approx(abs(free), rel=1e-8, abs=1e-12 + 1e-9 * braking)
    assert free * after >= 0.0


@given(free=st.floats(1e-3, 100.0), braking=st.floats(1e-3, 100.0), transition=st.floats(1e-2, 100.0))
def test_the_step_through_standstill_is_close_to_that_with_tanh(
    free: float, braking: float, transition: float
) -> None:
    after = float(speed_through_standstill(free, braking, 1 / transition))
    exact = brentq(lambda w: w + braking * math.tanh(w / transition) - free, 0.0, free, xtol=1e-14)
    # The two smooth signs differ by at most 0.005, and friction grows with the speed.
    assert abs(after - exact) <= 5e-3 * braking + 1e-9


@given(free=SPEEDS, braking=RATIOS, transition=st.floats(1e-3, 1e3))
def test_smooth_friction_is_odd_and_dissipates_energy(free: float, braking: float, transition: float) -> None:
    after = float(speed_through_standstill(free, braking, 1 / transition))
    assert float(speed_through_standstill(-free, braking, 1 / transition)) == -after
    assert abs(after) <= abs(free) * (1 + 1e-12)


@given(speeds=st.tuples(SPEEDS, SPEEDS), braking=RATIOS, transition=st.floats(1e-3, 1e3))
def test_smooth_friction_reduces_the_difference_of_two_speeds(
    speeds: tuple[float, float], braking: float, transition: float
) -> None:
    first, second = (float(speed_through_standstill(w, braking, 1 / transition)) for w in speeds)
    assert abs(first - second) <= abs(speeds[0] - speeds[1]) + 1e-9 * braking + 1e-9


@given(free=st.floats(-100.0, 100.0), braking=st.floats(0.0, 100.0))
def test_with_a_transition_speed_near_0_the_shaft_sticks(free: float, braking: float) -> None:
    after = float(speed_through_standstill(free, braking, 1e6))
    # Below the level of friction the shaft creeps at less than four times the transition speed of 1e-6.
    assert after == pytest.approx(float(speed_against(free, braking)), rel=1e-8, abs=4e-6)


@given(free=SPEEDS, braking=st.just(0.0) | RATIOS)
def test_dry_friction_reduces_the_speed_by_its_level_or_to_0(free: float, braking: float) -> None:
    after = float(speed_against(free, braking))
    assert abs(after) == max(abs(free) - braking, 0.0)
    assert free * after >= 0.0


@given(a=st.floats(-0.99, 0.99), speed=st.floats(1e-3, 1e3))
def test_directions_differ_by_the_asymmetry(a: float, speed: float) -> None:
    assert float(directional(speed, a)) == pytest.approx(1 + a, rel=1e-15)
    assert float(directional(-speed, a)) == pytest.approx(1 - a, rel=1e-15)


FACTORS = st.floats(0.0, 0.9)


@given(by_motor=FACTORS, by_external=FACTORS, load=st.floats(0.1, 10.0))
def test_efficiencies_of_a_screw_are_the_closed_form(
    by_motor: float, by_external: float, load: float
) -> None:
    """The torque of the motor under a steady load, by a root of the balance of torques."""

    def excess(motor: float, direction: float) -> float:
        lost = float(transmitted_friction(motor, -load, by_motor, by_external))
        return motor - load - direction * lost

    driving = brentq(excess, 0.0, 1e4, args=(1.0,), xtol=1e-13)
    assert load / driving == pytest.approx((1 - by_motor) / (1 + by_external), rel=1e-9)
    held = brentq(excess, 0.0, 1e4, args=(-1.0,), xtol=1e-13)
    assert held / load == pytest.approx((1 - by_external) / (1 + by_motor), rel=1e-9)


LOAD, INERTIA = 0.1, 2.5e-5
IDLE = altered(
    mechanics=FREE,
    controller={"position_gain": 1e-12, "speed_gain": 1e-12, "speed_limit": None},
    motor={"torque_constant": 1e-9},
)
"""The shaft of the thesis without friction and with a load; the torque of the motor is negligible."""

DRY = {"static_friction_motor": 0.03, "dynamic_friction_motor": 0.015}
VISCOUS = {"viscous_motor": 2e-5}


def still(t: Array) -> Array:
    return np.zeros_like(t)


@pytest.mark.parametrize(("by_external", "moves"), [(0.97, True), (1.03, False)])
def test_a_screw_is_self_locking_from_a_factor_of_1(by_external: float, moves: bool) -> None:
    # Other values of 0 have no effect; `test_laws_with_neutral_values_have_no_effect` has the same kernel.
    actuator = altered(
        IDLE, friction={"load_external": by_external, "coulomb_asymmetry": 0.0, "quadratic": 0.0}
    )
    signals = record(AVERAGED, still, actuator, load=LOAD, duration=0.02, sampling="instant")
    assert bool(np.any(signals["speed_rad_s"])) is moves
    if moves:  # the load minus friction
        expected = -(1 - by_external) * LOAD / INERTIA * signals["time_s"]
        np.testing.assert_allclose(signals["speed_rad_s"], expected, rtol=1e-9, atol=1e-12)


def solved(friction: Callable[[float, float], float], t: Array, w: float) -> Array:
    """Return the speed of the shaft at the times `t` under the oscillating load and its friction."""

    def slope(t: float, y: Array) -> list[float]:
        load = float(oscillating(t))
        return [(-load - friction(float(y[0]), load)) / INERTIA]

    end = solve_ivp(slope, (0.0, float(t[-1])), [w], "LSODA", t, rtol=1e-9, atol=1e-9, max_step=2e-4)
    return np.asarray(end.y[0])


def oscillating(t: Any) -> Any:
    return 0.2 * np.cos(2 * np.pi * 40.0 * np.asarray(t))


def viscous(w: float) -> float:
    return 2e-5 * w


def smooth(w: float) -> float:
    return math.tanh(w / 3.0)


def low_speed(w: float) -> float:
    return math.exp(-((w / 20.0) ** 2))


Friction = Callable[[float, float], float]

LAWS: dict[str, tuple[dict[str, float], Friction]] = {
    # Without a Stribeck speed, friction in motion is dynamic.
    "transition": ({}, lambda w, _: 0.015 * smooth(w) + viscous(w)),
    # The other values of 0 have no effect; "all" has the same kernel.
    "stribeck, directional": (
        {
            "stribeck_speed": 20.0,
            "coulomb_asymmetry": 0.3,
            "viscous_asymmetry": -0.4,
            "load_external": 0.0,
            "quadratic": 0.0,
        },
        lambda w, _: (
            (0.015 + 0.015 * low_speed(w)) * (1 + math.copysign(0.3, w)) * smooth(w)
            + viscous(w) * (1 - math.copysign(0.4, w))
        ),
    ),
    "load-dependent, quadratic": (
        {"load_motor": 0.05, "load_external": 0.3, "quadratic": 2e-6},
        lambda w, load: (0.015 + 0.3 * abs(load)) * smooth(w) + viscous(w) + 2e-6 * w * abs(w),
    ),
    "all": (
        {
            "stribeck_speed": 20.0,
            "load_external": 0.3,
            "stribeck_load_external": 0.2,
            "coulomb_asymmetry": 0.3,
            "viscous_asymmetry": -0.4,
            "quadratic": 2e-6,
        },
        lambda w, load: (
            (0.015 + 0.3 * abs(load) + low_speed(w) * (0.015 + 0.2 * abs(load)))
            * (1 + math.copysign(0.3, w))
            * smooth(w)
            + viscous(w) * (1 - math.copysign(0.4, w))
            + 2e-6 * w * abs(w)
        ),
    ),
}
"""Parameters of each law in addition to a transition speed of 3 rad/s, and friction [N·m] by speed [rad/s]
and load [N·m], in smooth functions."""


@pytest.mark.parametrize("law", LAWS)
def test_the_motion_under_an_oscillating_load_agrees_with_solve_ivp(law: str) -> None:
    described, friction = LAWS[law]
    actuator = altered(IDLE, mechanics=DRY | VISCOUS, friction={"transition_speed": 3.0} | described)
    errors = []
    for step in (1e-4, 2.5e-5):
        signals = record(
            AVERAGED,
            still,
            actuator,
            load=oscillating,
            duration=0.1,
            interval=1e-4,
            step=step,
            start=Initial(speed=-20.0),
            sampling="instant",
        )
        expected = solved(friction, signals["time_s"], -20.0)
        errors.append(float(rms(signals["speed_rad_s"] - expected) / rms(expected)))
    # The load, held over each step, is half a step late: 2π 40 Hz × 1e-4 s / 2 = 1.3 %.
    assert errors[0] < 0.02
    # First order, down to the difference of the smooth sign from tanh: 0.005 of dry friction near standstill.
    assert errors[1] < errors[0] / 3 + 5e-4


@pytest.mark.parametrize("model", [AVERAGED, REFERENCE], ids=["averaged", "reference"])
def test_the_recorded_torque_gives_the_recorded_speed_with_all_laws_of_friction(model: Model) -> None:
    """With the torque recorded at each step, the smooth equation gives the recorded speed."""
    user = dict.fromkeys(("viscous_user", "static_friction_user", "dynamic_friction_user"), 0.0)
    described = LAWS["all"][0] | {"transition_speed": 3.0, "load_motor": 0.1}
    actuator = altered(mechanics=DRY | VISCOUS | user, friction=described)
    signals = record(model, Sine(5e-3, 15.0), actuator, load=0.05, duration=0.1, interval=model.step)
    w, torque = signals["speed_rad_s"], signals["torque_Nm"]
    level = 0.015 + np.abs(0.1 * torque + 0.3 * 0.05) + np.exp(-((w / 20.0) ** 2)) * (0.015 + 0.2 * 0.05)
    friction = level * (1 + 0.3 * np.sign(w)) * np.tanh(w / 3.0)
    friction += 2e-5 * w * (1 - 0.4 * np.sign(w)) + 2e-6 * w * np.abs(w)
    impulse = np.cumsum(torque - 0.05 - friction) * model.step / INERTIA
    assert np.ptp(w) > 200.0
    # 0.005 of dry friction near standstill, and the error of explicit terms in a step.
    assert rms(w - impulse) < 0.01 * rms(w)


def test_laws_with_neutral_values_have_no_effect() -> None:
    neutral = {"load_motor": 0.0, "coulomb_asymmetry": 0.0, "viscous_asymmetry": 0.0, "quadratic": 0.0}
    command = Sine(5e-3, 15.0)
    for step, bound in ((5e-5, 0.02), (1e-5, 5e-3)):
        without_laws, with_laws = (
            record(AVERAGED, command, actuator, duration=0.2, interval=1e-3, step=step)
            for actuator in (Actuator.thesis(), altered(friction=neutral))
        )
        # At each stop and start of the shaft, static friction acts one step longer.
        for name in ("current_A", "speed_rad_s", "position_rad"):
            assert rms(with_laws[name] - without_laws[name]) < bound * rms(without_laws[name]), name
