"""Dry friction and motion against closed forms, as a law and within a kernel."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from emaphm.actuator import Sampled
from emaphm.simulation import AVERAGED, MODELS, Initial, Model
from emaphm.simulation.laws.angles import turn
from emaphm.simulation.laws.friction import speed_after
from simulation.rig import Shaft, altered, record

STATIC, DYNAMIC, J, DT = 0.2, 0.08, 2.5e-5, 1e-5
TORQUES = st.floats(-2.0, 2.0)
SPEEDS = st.floats(-900.0, 900.0)


def speeds(start: float, torque: float, steps: int) -> list[float]:
    """Return the speed at the start and after each step under a constant torque."""
    w = [start]
    for _ in range(steps):
        w.append(float(speed_after(w[-1], torque, STATIC, DYNAMIC, DT / J)))
    return w


@pytest.mark.parametrize("torque", [0.0, 0.1, -0.1, STATIC, -STATIC])
def test_the_shaft_sticks_up_to_static_friction(torque: float) -> None:
    assert speeds(0.0, torque, 50) == [0.0] * 51


@pytest.mark.parametrize("sign", [1, -1])
def test_the_shaft_breaks_away_above_static_friction_and_accelerates_uniformly(sign: int) -> None:
    torque = sign * np.nextafter(STATIC, 1)
    n = np.arange(101)
    expected = sign * n * DT * (STATIC - DYNAMIC) / J
    # Rounding of a hundred sums.
    np.testing.assert_allclose(speeds(0.0, torque, 100), expected, rtol=1e-13)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_shaft_coasts_to_an_exact_stop(sign: int) -> None:
    w0 = 10.05
    w = np.array(speeds(sign * w0, 0.0, 500))
    steps = math.ceil(J * w0 / DYNAMIC / DT)  # the time to stop is J w0 / f_d, 314.06 steps
    np.testing.assert_allclose(
        w[:steps], sign * (w0 - np.arange(steps) * DT * DYNAMIC / J), rtol=0, atol=1e-12
    )
    assert not w[steps:].any()


def test_only_dynamic_friction_acts_on_a_moving_shaft() -> None:
    # Between f_d and f_s a moving shaft accelerates, and a shaft at rest sticks.
    assert speeds(1.0, 0.1, 1)[1] == pytest.approx(1.0 + (0.1 - DYNAMIC) * DT / J, rel=1e-15)
    assert speeds(-1.0, 0.1, 1)[1] == pytest.approx(-1.0 + (0.1 + DYNAMIC) * DT / J, rel=1e-15)


@given(w=SPEEDS, torque=TORQUES)
def test_friction_is_odd_and_the_speed_never_crosses_zero(w: float, torque: float) -> None:
    after = float(speed_after(w, torque, STATIC, DYNAMIC, DT / J))
    assert float(speed_after(-w, -torque, STATIC, DYNAMIC, DT / J)) == -after
    assert w * after >= 0


@given(w=SPEEDS, torque=TORQUES)
def test_friction_never_adds_energy(w: float, torque: float) -> None:
    after = float(speed_after(w, torque, STATIC, DYNAMIC, DT / J))
    frictionless = w + torque * DT / J
    rounding = 1e-12  # of speeds up to 900 rad/s
    assert abs(after) <= abs(frictionless) + rounding
    if after:
        # In a step that does not end at rest, the full f_d acts against the motion.
        assert frictionless - after == pytest.approx(math.copysign(DYNAMIC * DT / J, after), abs=rounding)


DRIFTING = altered(
    controller={"position_gain": 1e-12, "speed_gain": 1e-12},
    motor={"torque_constant": 1e-9},
    mechanics={"viscous_motor": 0.0, "viscous_user": 0.0, "end_stops": None},
)
"""The shaft of the thesis with load and friction only: the torque of the motor is negligible."""


def rest(t: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.zeros_like(t)


@pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))
def test_a_pushed_shaft_moves_as_in_the_closed_form(model: Model) -> None:
    static, dynamic, inertia = 0.1 * 1.689, 0.05 * 1.689, 2.5e-5
    # The load is slightly less than f_s for 10 ms, 0.3 N·m for 20 ms, and then 0.
    on, off, push, edge = 10e-3, 30e-3, 0.3, 1e-9
    load = Sampled([on, on + edge, off, off + edge], [-0.999 * static, -push, -push, 0])
    signals = record(model, rest, DRIFTING, load=load, duration=0.1, interval=1e-3, sampling="instant")
    t = signals["time_s"]
    slope = (push - dynamic) / inertia
    fastest = slope * (off - on)
    stop = off + inertia * fastest / dynamic  # 81 ms
    expected = slope * np.clip(t - on, 0, off - on) - dynamic / inertia * np.clip(t - off, 0, stop - off)
    # The load changes at the start of a step, and a row has the values at the end of its step.
    np.testing.assert_allclose(signals["speed_rad_s"], expected, rtol=0, atol=2.01 * slope * model.step)
    assert not signals["speed_rad_s"][t < on].any()
    assert signals["speed_rad_s"][(t > on) & (t < stop - 2 * model.step)].all()
    assert not signals["speed_rad_s"][t > stop + 2 * model.step].any()


@pytest.mark.parametrize("sign", [1, -1])
def test_motion_is_semi_implicit_and_uniformly_accelerated(sign: int) -> None:
    shaft = Shaft(DT, static=STATIC, coulomb=DYNAMIC, step_per_inertia=DT / J)
    for _ in range(200):
        shaft.move(sign * 0.5)
    acceleration = sign * (0.5 - DYNAMIC) / J
    assert shaft.state["speed"] == pytest.approx(200 * DT * acceleration, rel=1e-12)
    # The angle follows from the new speed: dt² a n (n + 1) / 2.
    assert shaft.state["angle"] == pytest.approx(DT**2 * acceleration * 200 * 201 / 2, rel=1e-12)
    assert shaft.state["output"] == shaft.state["angle"]


def test_with_viscous_friction_the_speed_decays_exponentially() -> None:
    C, w0, n = 1e-4, 100.0, 2000
    shaft = Shaft(DT, viscous=C, step_per_inertia=DT / J)
    shaft.state["speed"] = w0
    for _ in range(n):
        shaft.move(0.0)
    # Explicit Euler at a rate C / J = 4 /s over 20 ms: an error of half the rate times the step, 2e-5 of 8 %.
    assert shaft.state["speed"] == pytest.approx(w0 * math.exp(-n * DT * C / J), rel=2e-6)


@given(angle=st.floats(-np.pi, np.pi), by=st.floats(-0.1, 0.1))
def test_turn_rotates_a_direction(angle: float, by: float) -> None:
    cos, sin = turn(np.cos(angle), np.sin(angle), by)
    # The series are cut at by⁴ and by⁵; in addition there is rounding.
    bound = by**6 / 720 + 4e-16
    assert abs(cos - np.cos(angle + by)) < bound + abs(by) ** 7 / 5040
    assert abs(sin - np.sin(angle + by)) < bound + abs(by) ** 7 / 5040


def test_ten_thousand_turns_have_a_bounded_error() -> None:
    cos, sin, by = 1.0, 0.0, 0.02
    for _ in range(10_000):
        cos, sin = turn(cos, sin, by)
    bound = 10_000 * by**6 / 720 * 1.1 + 1e-12
    assert abs(complex(cos, sin) - np.exp(1j * 10_000 * by)) < bound


def test_a_run_starts_at_its_speed_and_angle() -> None:
    signals = record(AVERAGED, rest, DRIFTING, duration=1e-3, interval=5e-5, start=Initial(3.0, speed=50.0))
    # The first row has the values at the end of the first step: friction has acted for 50 us.
    speed = 50.0 - 0.05 * 1.689 / 2.5e-5 * 5e-5
    assert signals["speed_rad_s"][0] == pytest.approx(speed, rel=1e-9)
    assert signals["angle_rad"][0] == pytest.approx(3.0 + speed * 5e-5, rel=1e-9)
