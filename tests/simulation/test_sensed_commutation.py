"""Commutation by Hall sensors: binary signals, closed forms at standstill, and agreement of both models."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from emaphm.actuator import Actuator, Chirp, Faults, Step
from emaphm.arrays import Array
from emaphm.errors import ActuatorError
from emaphm.simulation import AVERAGED, REFERENCE, Initial, Model
from emaphm.simulation.laws.angles import phase_angles
from emaphm.simulation.laws.commutation import demand_sign, of_idle_phase
from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.sensed_commutation import (
    MOST_EARLY,
    early_by_turning,
    hall_signals,
    of_sensed_idle_phase,
    over_a_turn,
    seen_angle,
    signalled_demand,
)
from simulation.rig import LOCKED, THESIS, altered, record, rms

K = 0.0752
NUMBERS = Phases(0.0, 1.0, 2.0)
LOW = Phases(-1.0, -1.0, -1.0)
ANGLES = np.radians(np.arange(-180.0, 180.0, 0.5) + 0.25)
EARLY = st.tuples(*[st.floats(-22.0, 22.0)] * 3).map(lambda degrees: Phases(*np.radians(degrees)))
PI = {"current_gain": 2.0, "current_integral_gain": 5e3, "pwm_frequency": 2e4}
DRIVES: list[dict[str, Any]] = [{}, {"drive": {"kind": "six-step"} | PI}]


def displaced(a: float, b: float, c: float, **sections: Any) -> Actuator:
    """Return the thesis's actuator whose Hall sensors are early by a, b and c degrees."""
    early = {f"hall_{name}": math.radians(degrees) for name, degrees in zip("abc", (a, b, c), strict=True)}
    return altered(THESIS, **{**sections, "motor": early | sections.get("motor", {})})


def binary_signals(early: Phases) -> Array:
    """Return the Hall signals at `ANGLES`, (3, n), high for half a turn from the flat of the phase."""
    own = [ANGLES - math.radians(30 + 120 * n) + error for n, error in enumerate(early)]
    return (np.mod(own, 2 * np.pi) < np.pi).astype(float)


@given(early=EARLY)
def test_two_phases_conduct_while_their_binary_signals_differ(early: Phases) -> None:
    high = binary_signals(early)
    signals = hall_signals(LOW, phase_angles(ANGLES), early, 0.0)
    np.testing.assert_array_equal(np.stack([*signals]), 2 * high - 1)
    signs = np.stack([*signalled_demand(signals)])
    np.testing.assert_array_equal(signs, high - np.roll(high, -1, axis=0))
    idle = of_sensed_idle_phase(ANGLES, NUMBERS, early)
    np.testing.assert_array_equal(signs == 0, idle == np.arange(3)[:, np.newaxis])


def test_exact_hall_sensors_commutate_by_the_rotor_angle() -> None:
    nowhere = Phases(0.0, 0.0, 0.0)
    idle = of_sensed_idle_phase(ANGLES, NUMBERS, nowhere)
    np.testing.assert_array_equal(idle, of_idle_phase(ANGLES, NUMBERS))
    angles = phase_angles(ANGLES)
    signs = signalled_demand(hall_signals(LOW, angles, nowhere, 0.0))
    for sensed, by_angle in zip(signs, demand_sign(angles), strict=True):
        np.testing.assert_array_equal(sensed, by_angle)


@settings(max_examples=20)
@given(early=EARLY, share=st.floats(0.0, 1.0), backward=st.booleans())
@example(early=Phases(0.0, 0.0, math.radians(-22.0)), share=1.0, backward=False)
def test_hysteresis_delays_each_edge_in_the_direction_of_rotation(
    early: Phases, share: float, backward: bool
) -> None:
    # Beyond `MOST_EARLY` in all, an edge is moved no further.
    lag = share * min(0.15, MOST_EARLY - max(map(abs, early)))
    # The second turn is compared: at the start of the first, sensors may be within their hysteresis band.
    turn = np.tile(ANGLES[::6], 2)[:: -1 if backward else 1]
    signals, idle = hall_signals(LOW, phase_angles(turn[0]), early, 0.0), list[int]()
    for angle in turn:
        signals = hall_signals(signals, phase_angles(angle), early, lag)
        idle.append([float(sign) for sign in signalled_demand(signals)].index(0.0))
    late = early_by_turning(early, -5.0 if backward else 5.0, lag, 0.0)
    half = turn.size // 2
    np.testing.assert_array_equal(idle[half:], of_sensed_idle_phase(turn[half:], NUMBERS, late))


@given(lag=st.floats(-0.15, 0.15), delay=st.floats(-1e-4, 1e-4), speed=st.floats(-1e3, 1e3))
def test_a_delay_and_a_lead_shift_the_sensed_angle(lag: float, delay: float, speed: float) -> None:
    lead = -delay * speed + max(-lag, 0.0) * np.sign(speed)
    sensed = seen_angle(0.3, speed, lag, delay)
    assert sensed == pytest.approx(0.3 + lead, abs=1e-12)
    # A delay by the angle and by the sensors reduces the lead by the same angle.
    early = early_by_turning(Phases(0.0, 0.0, 0.0), speed, lag, delay).a
    assert early == pytest.approx(-delay * speed - lag * np.sign(speed), abs=1e-12)


@given(early=EARLY, turned=st.floats(-0.12, 0.12).filter(lambda turned: abs(turned) > 1e-3))
def test_over_a_turn_is_the_mean_of_the_values_of_idle_phases(early: Phases, turned: float) -> None:
    values = Phases(1.0, -2.0, 5.0)
    shares = (np.arange(4000) + 0.5) / 4000
    passed = np.mod(ANGLES[::9, np.newaxis] + turned * shares + np.pi, 2 * np.pi) - np.pi
    expected = of_sensed_idle_phase(passed, values, early).mean(axis=1)
    np.testing.assert_allclose(over_a_turn(ANGLES[::9], turned, values, early), expected, atol=6e-3)


def test_without_a_turn_over_a_turn_is_the_value_of_the_idle_phase() -> None:
    early, values = Phases(0.1, -0.2, 0.3), Phases(1.0, -2.0, 5.0)
    expected = of_sensed_idle_phase(ANGLES, values, early)
    np.testing.assert_array_equal(over_a_turn(ANGLES, 0.0, values, early), expected)


@pytest.mark.parametrize(
    ("model", "bound"), [(AVERAGED, 1e-4), (REFERENCE, 0.01)], ids=["averaged", "reference"]
)
@pytest.mark.parametrize("drive", DRIVES, ids=["hysteresis", "six-step"])
@pytest.mark.parametrize(
    ("early", "electrical", "factor"),
    [
        ((0.0, 0.0, 0.0), 75.0, 1.0),
        # Phase b, whose flat ends at 90 degrees, conducts up to 102: at 98 it is on the ramp.
        ((0.0, 0.0, -12.0), 98.0, (1 + 22 / 30) / 2),
        # Phase c, whose flat begins at 90 degrees, conducts from 84: at 86 it is before the flat.
        ((0.0, 0.0, 6.0), 86.0, (1 + 26 / 30) / 2),
    ],
)
def test_a_stalled_motor_has_the_torque_of_its_conducting_phases(
    model: Model,
    bound: float,
    drive: dict[str, Any],
    early: tuple[float, float, float],
    electrical: float,
    factor: float,
) -> None:
    start = Initial(rotor_offset=math.radians(electrical) / 2)
    actuator = displaced(
        *early,
        **drive,
        motor={"torque_limit": None},
        mechanics=LOCKED,
        controller={"current_limit": 10.0},
    )
    signals = record(model, Step(0.1), actuator, duration=0.02, start=start, interval=1e-3)
    torque, current = signals["torque_Nm"][-1], signals["current_A"][-1]
    assert torque == pytest.approx(K * current, rel=bound)
    # Hysteresis controls the phase currents, PI control the equivalent current.
    assert abs(current) == pytest.approx(10.0 if drive else 10.0 * factor, abs=0.6 if not drive else 0.1)


LATE = {"hall_a": 0.14, "hall_b": -0.09, "hall_c": 0.07}


@pytest.mark.parametrize("drive", DRIVES, ids=["hysteresis", "six-step"])
@pytest.mark.parametrize(
    ("motor", "late"),
    [
        (LATE, {}),
        ({}, {"commutation_lag": 0.12}),
        ({}, {"commutation_lag": -0.12}),
        ({}, {"commutation_lag": 0.08, "commutation_delay": 2e-4}),
    ],
    ids=["hall", "hysteresis", "lead", "hysteresis and delay"],
)
def test_commutation_errors_have_the_same_effect_in_both_models(
    drive: dict[str, Any], motor: dict[str, float], late: dict[str, float]
) -> None:
    faults = Faults(0.2, short_a=0.3, short_b=0.1)

    def currents(actuator: Actuator) -> Array:
        runs = [
            record(model, Chirp(), actuator, faults=faults, duration=0.3) for model in (AVERAGED, REFERENCE)
        ]
        return np.array([signals["current_A"] for signals in runs])

    plain = altered(THESIS, **(drive or {"drive": {"kind": "hysteresis"}}))
    without, with_error = currents(plain), currents(altered(plain, motor=motor, drive=late))
    of_averaged, of_reference = with_error - without
    assert rms(of_averaged) > 0.02 * rms(without[1])
    assert rms(of_averaged - of_reference) < 0.3 * rms(of_reference) + rms(without[0] - without[1])
    assert rms(with_error[0] - with_error[1]) < 1.25 * rms(without[0] - without[1])


@pytest.mark.parametrize(
    ("actuator", "message"),
    [
        ({"drive": {"kind": "voltage"}, "motor": {"hall_b": 0.1}}, "'motor.hall_b'.*out"),
        (
            {"drive": {"kind": "voltage", "commutation_delay": 1e-5}},
            "'drive.commutation_delay': .*take it out",
        ),
        ({"motor": {"hall_a": 0.5}}, "'motor.hall_a': should be less than or equal to 0.4"),
    ],
)
def test_impossible_hall_sensors_are_refused(actuator: dict[str, Any], message: str) -> None:
    with pytest.raises(ActuatorError, match=message):
        altered(THESIS, **actuator)
