"""The compliant shaft: oscillation in closed form, gap, energy, and the limit of a rigid shaft."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.actuator import Actuator, Sine, Step
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, REFERENCE
from emaphm.simulation.laws.compliant_shaft import shaft_torque
from simulation.rig import FREE, THESIS, altered, record, rms

MOTOR, USER = 1.3e-5, 1.2e-5
REDUCED = MOTOR * USER / (MOTOR + USER)
NATURAL = 2 * math.pi * 500.0
STIFFNESS = NATURAL**2 * REDUCED
LOAD = 0.05
NUMBERS = st.floats(-10.0, 10.0)


def idle(stiffness: float, damping: float = 0.0, backlash: float = 0.0) -> Actuator:
    """Return the inertias of the thesis without friction or motor torque, connected by a shaft."""
    return altered(
        mechanics=FREE | {"backlash": backlash},
        controller={"position_gain": 1e-12, "speed_gain": 1e-12, "speed_limit": None},
        motor={"torque_constant": 1e-9},
        transmission={"stiffness": stiffness, "damping": damping},
    )


def pushed(actuator: Actuator, step: float, duration: float = 0.02) -> dict[str, Array]:
    """Return the motion from rest under a constant load, one row per step, with the user in motor angles."""
    signals = record(
        AVERAGED,
        lambda t: 0 * t,
        actuator,
        load=LOAD,
        duration=duration,
        interval=step,
        step=step,
        sampling="instant",
    )
    return signals | {"user": signals["position_rad"] * 500}


@given(twist=NUMBERS, rate=NUMBERS, half_gap=st.floats(0.0, 5.0), damping=st.floats(0.0, 5.0))
def test_the_torque_of_the_shaft_acts_outside_the_gap_and_only_pushes(
    twist: float, rate: float, half_gap: float, damping: float
) -> None:
    torque = float(shaft_torque(twist, rate, half_gap, 3.0, damping))
    if abs(twist) <= half_gap:
        assert torque == 0.0
    else:
        beyond = math.copysign(abs(twist) - half_gap, twist)
        assert torque * twist >= 0.0
        assert torque in (0.0, pytest.approx(3.0 * beyond + damping * rate, abs=1e-12))


@pytest.mark.parametrize("ratio", [0.0, 0.05])
def test_the_shaft_oscillates_as_in_the_closed_form(ratio: float) -> None:
    actuator = idle(STIFFNESS, 2 * ratio * NATURAL * REDUCED)
    errors = []
    for step in (1e-5, 2.5e-6):
        signals = pushed(actuator, step)
        t = signals["time_s"]
        damped = NATURAL * math.sqrt(1 - ratio**2)
        swing = np.cos(damped * t) + ratio / math.sqrt(1 - ratio**2) * np.sin(damped * t)
        final = LOAD * REDUCED / USER / STIFFNESS
        twist = final * (1 - np.exp(-ratio * NATURAL * t) * swing)
        errors.append(np.abs(signals["angle_rad"] - signals["user"] - twist).max() / final)
        # The centre of both inertias moves like one inertia.
        centre = (MOTOR * signals["angle_rad"] + USER * signals["user"]) / (MOTOR + USER)
        expected = -LOAD / (MOTOR + USER) * t * (t + step) / 2
        np.testing.assert_allclose(centre, expected, rtol=1e-9, atol=1e-12)
    # Semi-implicit Euler is half a step early, ω Δt / 2 of the amplitude.
    assert errors[0] < NATURAL * 1e-5
    assert errors[1] < 0.3 * errors[0]


def test_frequency_and_damping_have_the_stated_error_at_the_step_of_a_fit() -> None:
    """Over ten periods, the frequency is too high by (ω Δt)²/24 + ζ ω Δt / 2; the damping is as described."""
    ratio = 0.02
    signals = pushed(idle(STIFFNESS, 2 * ratio * NATURAL * REDUCED), AVERAGED.step)
    twist = signals["angle_rad"] - signals["user"]
    final = LOAD * REDUCED / USER / STIFFNESS
    crossings = np.flatnonzero(np.diff(np.sign(twist - final)) != 0)
    share = (final - twist[crossings]) / (twist[crossings + 1] - twist[crossings])
    times = signals["time_s"][crossings] + share * AVERAGED.step
    frequency = (len(times) - 1) / 2 / (times[-1] - times[0])
    phase = NATURAL * AVERAGED.step
    high = 1 + phase**2 / 24 + ratio * phase / 2
    assert frequency == pytest.approx(500.0 * math.sqrt(1 - ratio**2) * high, rel=5e-4)
    peaks = np.array([np.abs(twist - final)[a:b].max() for a, b in pairwise(crossings)])
    decrement = -np.polyfit(np.arange(len(peaks)), np.log(peaks), 1)[0]  # half a period apart
    assert decrement == pytest.approx(math.pi * ratio, rel=0.1)  # from four rows per quarter period


def test_within_the_gap_the_shaft_transmits_no_torque() -> None:
    half = 2.5e-3
    signals = pushed(idle(STIFFNESS, 0.0, 2 * half), 1e-6, 0.01)
    t, inside = signals["time_s"], np.abs(signals["angle_rad"] - signals["user"]) <= half
    alone = t < math.sqrt(2 * half * USER / LOAD) - 2e-6
    assert inside[alone].all()
    assert np.abs(signals["angle_rad"][alone]).max() < 1e-30  # the torque of the motor is negligible
    np.testing.assert_allclose(signals["user"][alone], -LOAD / USER * (t * (t + 1e-6) / 2)[alone], rtol=1e-9)
    # After the gap, the user drives the motor.
    assert signals["angle_rad"][-1] < -half


@pytest.mark.parametrize("backlash", [0.0, 5e-3])
def test_the_energy_is_the_work_of_the_load(backlash: float) -> None:
    errors = []
    for step in (4e-6, 1e-6):
        signals = pushed(idle(STIFFNESS, 0.0, backlash), step)
        w = signals["speed_rad_s"]
        user_speed = np.gradient(signals["user"], step)
        twist = signals["angle_rad"] - signals["user"]
        beyond = np.maximum(np.abs(twist) - backlash / 2, 0.0)
        energy = MOTOR * w**2 / 2 + USER * user_speed**2 / 2 + STIFFNESS * beyond**2 / 2
        work = -LOAD * signals["user"]
        errors.append(np.abs(energy - work)[1:-1].max() / work[-1])
    # The energy of semi-implicit Euler oscillates by ω Δt / 2 of the oscillating part, less than the whole.
    assert errors[0] < 0.02
    assert errors[1] < 0.4 * errors[0]


SHAFT = altered(mechanics={"backlash": 0.0})
SLIDING = altered(mechanics=FREE | {"backlash": 0.0, "viscous_motor": 1e-3})


def driven(actuator: Actuator, **options: Any) -> dict[str, Array]:
    return record(AVERAGED, Sine(5e-3, 15.0), actuator, duration=0.2, interval=1e-3, **options)


def test_a_stiff_shaft_converges_to_a_rigid_one() -> None:
    rigid = driven(SLIDING, step=1e-5)
    differences = []
    for hertz in (500.0, 2000.0):
        natural = 2 * math.pi * hertz
        transmission = {"stiffness": natural**2 * REDUCED, "damping": 0.2 * natural * REDUCED}
        soft = driven(altered(SLIDING, transmission=transmission), step=1e-5)
        differences.append(rms(soft["position_rad"] - rigid["position_rad"]) / rms(rigid["position_rad"]))
    # A shaft of 500 Hz at 15 Hz: the user has a lead of (15/500)², which falls with the stiffness.
    assert differences[0] < 5e-3
    assert differences[1] < differences[0] / 8


@pytest.mark.parametrize("stiffness", [1e3, 1e6, 1e12])
@pytest.mark.parametrize("damping", [0.0, 1.0, 1e6])
def test_a_shaft_too_stiff_for_the_step_is_stable_and_close_to_rigid(
    stiffness: float, damping: float
) -> None:
    rigid = driven(SHAFT)
    stiff = driven(altered(SHAFT, transmission={"stiffness": stiffness, "damping": damping}))
    for name in ("position_rad", "speed_rad_s"):
        assert rms(stiff[name] - rigid[name]) < 0.02 * rms(rigid[name]), name


@pytest.mark.parametrize(
    ("hertz", "share"), [(100.0, 1.0), (2200.0, 1.0), (4456.0, 0.5), (8913.0, 0.25), (1e5, 0.25)]
)
def test_the_step_is_shorter_for_a_shaft_with_a_high_frequency(hertz: float, share: float) -> None:
    natural = 2 * math.pi * hertz
    actuator = altered(transmission={"stiffness": natural**2 * REDUCED})
    assert AVERAGED.step_for(actuator) == pytest.approx(share * AVERAGED.step, rel=1e-3)
    assert AVERAGED.step_for(THESIS) == AVERAGED.step
    assert REFERENCE.step_for(actuator) == REFERENCE.step


def test_friction_of_each_side_in_motion_is_no_larger_than_at_rest() -> None:
    # The sum satisfies this, but the part of the user would not, and would move against its load.
    most = 0.1 * 1.689
    friction = {"static_friction_motor": most, "static_friction_user": 0.0}
    friction |= {"dynamic_friction_motor": 0.3 * most, "dynamic_friction_user": 0.2 * most}
    soft = altered(SHAFT, mechanics=friction)
    signals = record(AVERAGED, Step(0.0), soft, duration=0.05, load=1e-4)
    assert np.max(signals["position_rad"]) <= 0.0
