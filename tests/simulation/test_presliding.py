"""Presliding friction of bristles: the implicit step, motion against solve_ivp, and hysteresis at rest."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from emaphm.actuator import Actuator, Sine
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, REFERENCE, Initial, Model
from emaphm.simulation.laws.presliding import speed_against_bristles
from emaphm.simulation.laws.standstill import speed_against
from simulation.rig import FREE, altered, record, rms

SPEEDS, RATIOS = st.floats(-1e3, 1e3), st.floats(1e-4, 1e3)
INERTIA, LEVEL, STIFFNESS = 2.5e-5, 0.015, 0.5
DAMPING = 0.4 * math.sqrt(STIFFNESS * INERTIA)
DRY = {"static_friction_motor": 2 * LEVEL, "dynamic_friction_motor": LEVEL}
BRISTLES = {"presliding_stiffness": STIFFNESS, "presliding_damping": DAMPING}
IDLE: dict[str, Any] = {
    "controller": {"position_gain": 1e-12, "speed_gain": 1e-12, "speed_limit": None},
    "motor": {"torque_constant": 1e-9},
}
"""A motor with negligible torque, so that only the load drives the shaft."""


def loaded(**sections: Any) -> Actuator:
    return altered(**IDLE | {"mechanics": FREE | DRY, "friction": BRISTLES} | sections)


def step(free: float, braking: float, held: float, give: float, damping: float) -> tuple[float, float]:
    after, holding = speed_against_bristles(free, braking, held, give, damping)
    return float(after), float(holding)


@given(
    free=SPEEDS,
    braking=RATIOS,
    bent=st.floats(-1.0, 1.0),
    give=st.floats(1e-4, 1e2),
    damping=st.floats(0, 10),
)
def test_the_step_solves_its_implicit_equations(
    free: float, braking: float, bent: float, give: float, damping: float
) -> None:
    held = bent * braking
    after, holding = step(free, braking, held, give, damping)
    scale = abs(free) + braking * (1 + damping / give)
    assert after + holding + damping / give * (holding - held) == pytest.approx(free, abs=1e-9 * scale)
    slid = (1 + give / braking * abs(after)) * holding
    assert slid == pytest.approx(held + give * after, abs=1e-9 * (braking + give * abs(after)))
    # The force of the bristles never exceeds the level of friction.
    assert abs(holding) <= braking * (1 + 1e-9)
    assert step(-free, braking, -held, give, damping) == (-after, -holding)


@given(free=SPEEDS, braking=RATIOS)
def test_stiff_bristles_stick_like_dry_friction(free: float, braking: float) -> None:
    after, _ = step(free, braking, 0.0, 1e9, 0.0)
    assert after == pytest.approx(float(speed_against(free, braking)), rel=1e-4, abs=1e-4 * (braking + 1e-3))


def oscillating(t: Any) -> Any:
    return 0.2 * np.cos(2 * np.pi * 40.0 * np.asarray(t))


def test_the_motion_under_an_oscillating_load_agrees_with_solve_ivp() -> None:
    def slopes(t: float, x: Array) -> list[float]:
        w, z = x
        rate = w - STIFFNESS / LEVEL * abs(w) * z
        return [(-float(oscillating(t)) - STIFFNESS * z - DAMPING * rate) / INERTIA, rate]

    errors = []
    for dt in (1e-4, 2.5e-5):
        options: dict[str, Any] = {"duration": 0.1, "interval": 1e-4, "step": dt, "sampling": "instant"}
        start = Initial(speed=-20.0)
        signals = record(AVERAGED, np.zeros_like, loaded(), load=oscillating, start=start, **options)
        t = signals["time_s"]
        exact = solve_ivp(slopes, (0, t[-1]), [-20.0, 0.0], "LSODA", t, rtol=1e-9, atol=1e-9, max_step=1e-4)
        errors.append(float(rms(signals["speed_rad_s"] - exact.y[0]) / rms(exact.y[0])))
    # As in test_smooth_friction: the load is held over each step and so half a step late.
    assert errors[0] < 0.02
    assert errors[1] < errors[0] / 3


@pytest.mark.parametrize("compliant", [False, True], ids=["rigid", "compliant"])
def test_a_slow_torque_below_the_level_of_friction_causes_hysteresis(compliant: bool) -> None:
    shaft = {"transmission": {"stiffness": 20.0, "damping": 1e-3}} if compliant else {}
    signals = record(
        AVERAGED,
        np.zeros_like,
        loaded(mechanics=FREE | DRY | ({"backlash": 0.0} if compliant else {}), **shaft),
        load=lambda t: 0.5 * LEVEL * np.interp(t, [0.0, 2.0, 4.0], [0.0, 1.0, 0.0]),
        duration=4.0,
        interval=1e-3,
    )
    angle = signals["angle_rad"]
    # Bristles slide while they bend: dz/dθ = 1 - sgn(ω) z/z_s; its integral is a logarithm in each direction.
    sliding = LEVEL / STIFFNESS
    assert -angle[1999] == pytest.approx(-sliding * math.log(1 - 0.5), rel=0.015)
    assert angle[-1] - angle[1999] == pytest.approx(sliding * math.log(1 + 0.5), rel=0.015)


@pytest.mark.parametrize("model", [AVERAGED, REFERENCE], ids=["averaged", "reference"])
def test_the_recorded_torque_gives_the_recorded_speed_with_bristles(model: Model) -> None:
    """With the torque recorded at each step, the equations give the recorded speed."""
    user = dict.fromkeys(("viscous_user", "static_friction_user", "dynamic_friction_user"), 0.0)
    mechanics = DRY | {"viscous_motor": 0.0} | user
    actuator = altered(mechanics=mechanics, friction=BRISTLES | {"stribeck_speed": 20.0})
    signals = record(model, Sine(5e-3, 15.0), actuator, duration=0.05, interval=model.step)
    w, torque = signals["speed_rad_s"], signals["torque_Nm"]
    z, impulse = 0.0, np.zeros(w.size)
    friction = 0.0
    for i, speed in enumerate(w):
        level = LEVEL * (1 + math.exp(-((speed / 20.0) ** 2)))
        rate = speed - STIFFNESS / level * abs(speed) * z
        z += rate * model.step
        friction += (STIFFNESS * z + DAMPING * rate) * model.step
        impulse[i] = -friction
    moved = (np.cumsum(torque) * model.step + impulse) / INERTIA
    assert np.ptp(w) > 200.0
    assert rms(w - moved) < 0.01 * rms(w)
