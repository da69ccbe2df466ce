"""Effects of each fault on a run, against balances of torque, voltage and motion."""

import math

import numpy as np
import pytest

from emaphm.actuator import Actuator, Chirp, Faults, Ramp, Sampled, Sine
from emaphm.simulation import AVERAGED, MODELS, REFERENCE, Inputs, Model, Plant, run
from simulation.rig import INTERVAL, LOCKED, THESIS, altered, record, rms

EACH_MODEL = pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))

K, R_S, TAU = 0.0752, 2.13, 1 / 500
COULOMB, VISCOUS = 0.05 * 1.689, 30 / math.pi * 1e-6 + 4.5e-7
RATE = 0.1
"""Rate of a slow ramp [rad/s at the user]: 50 rad/s at the motor."""


def steady(model: Model, *, load: float = 0.0, sign: int = 1, **faults: float) -> dict[str, float]:
    """Return the mean of each channel over the last 0.1 s of a ramp of 0.4 s, at constant speed."""
    signals = record(model, Ramp(sign * RATE), faults=Faults(**faults), load=load, duration=0.4)
    assert np.mean(signals["speed_rad_s"][-500:]) == pytest.approx(sign * RATE / TAU, rel=1e-4)
    return {name: float(np.mean(values[-500:])) for name, values in signals.items()}


def bound(model: Model) -> float:
    """Return the relative error of a steady mean: rounding, or the imbalance by the ripple of the speed.

    J dw / 0.1 s with a ripple dw of some 1 rad/s is 2.5e-4 N·m, at a friction torque of 8e-2 N·m.
    """
    return 1e-9 if model is AVERAGED else 3e-3


@EACH_MODEL
@pytest.mark.parametrize("k1", [0.0, 0.25, 1.0])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_steady_current_balances_friction(model: Model, k1: float, sign: int) -> None:
    expected = sign * (COULOMB * (1 + 2 * k1) + VISCOUS * RATE / TAU) / K
    assert steady(model, sign=sign, friction=k1)["current_A"] == pytest.approx(expected, rel=bound(model))


@EACH_MODEL
@pytest.mark.parametrize("load", [0.1, -0.05])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_steady_current_balances_a_constant_load(model: Model, load: float, sign: int) -> None:
    expected = (sign * (COULOMB + VISCOUS * RATE / TAU) + load) / K
    assert steady(model, load=load, sign=sign)["current_A"] == pytest.approx(expected, rel=4 * bound(model))


@EACH_MODEL
def test_an_offset_acts_like_a_constant_load(model: Model) -> None:
    loaded = record(model, Chirp(), load=0.05, duration=0.1)
    offset = record(model, Chirp(), altered(mechanics={"offset": 0.05}), duration=0.1)
    assert np.array_equal(loaded["current_A"], offset["current_A"])


@EACH_MODEL
def test_a_sampled_load_acts_at_its_time(model: Model) -> None:
    on = 0.3
    signals = record(model, Ramp(RATE), load=Sampled([0, on, on + 1e-6, 1], [0, 0, 0.1, 0.1]), duration=0.6)
    before = np.mean(signals["current_A"][1000:1500])
    after = np.mean(signals["current_A"][-500:])
    assert after - before == pytest.approx(0.1 / K, rel=5 * bound(model))
    # The speed drops by 0.1 N·m / (GAP × the gain of the loop) and settles within J / GAP = 0.5 ms.
    assert np.mean(signals["current_A"][1510:1600]) == pytest.approx(after, rel=0.1)


@EACH_MODEL
@pytest.mark.parametrize("short", [0.3, 0.6])
def test_equal_shorts_reduce_torque_back_emf_and_resistance(model: Model, short: float) -> None:
    turns = 1 - short
    signals = steady(model, short_a=short, short_b=short, short_c=short)
    current = (COULOMB + VISCOUS * RATE / TAU) / (K * turns)
    assert signals["current_A"] == pytest.approx(current, rel=bound(model))
    voltage = K * turns * RATE / TAU + R_S * turns * current
    # The idle leg of the reference model also switches, with an effect of 1 % on the line voltage.
    assert signals["voltage_V"] == pytest.approx(voltage, rel=0.03 if model is REFERENCE else bound(model))


@pytest.mark.parametrize("phase", ["short_a", "short_b", "short_c"])
@pytest.mark.parametrize("model", [AVERAGED, REFERENCE], ids=["averaged", "reference"])
def test_a_single_short_acts_in_the_two_sectors_of_its_phase(model: Model, phase: str) -> None:
    signals = record(model, Ramp(RATE), faults=Faults(**{phase: 0.5}), duration=0.4)
    rotor = np.degrees(2 * signals["angle_rad"][1000:])
    idle = np.round(rotor / 60).astype(int) % 3  # 0: a idles, 1: c, 2: b (thesis 4.4)
    middle = np.abs(rotor / 60 - np.round(rotor / 60)) < 0.2
    healthy_sector = {"short_a": 0, "short_b": 2, "short_c": 1}[phase]
    current = signals["current_A"][1000:]
    healthy_current = current[middle & (idle == healthy_sector)].mean()
    shorted_current = current[middle & (idle != healthy_sector)].mean()
    # k is 1 in one sector, (1 + 0.5) / 2 in the others; at constant torque the currents are inverse, except
    # for a dip of the torque at the start of a sector: it lasts 0.5 ms, short compared with 10 ms.
    assert shorted_current / healthy_current == pytest.approx(1 / 0.75, rel=0.05)


@pytest.mark.parametrize("model", [AVERAGED, REFERENCE], ids=["averaged", "reference"])
@pytest.mark.parametrize("k7", [0.0, 0.25, 0.6])
def test_eccentricity_modulates_the_current_once_per_turn_at_its_phase(model: Model, k7: float) -> None:
    z, phi = 0.42 * 0.5, (2 * k7 - 1) * math.pi
    signals = record(model, Ramp(RATE), faults=Faults(eccentricity=0.5, eccentricity_phase=k7), duration=0.4)
    theta = signals["angle_rad"][1000:]
    third = 2 * np.pi / 3 * np.arange(3)[:, None]
    factors = 1 + z * np.cos(theta + phi + third)
    idle = np.round(np.degrees(2 * theta) / 60).astype(int) % 3
    conducting = np.array([[1, 2], [0, 1], [2, 0]])[idle]
    mean = np.take_along_axis(factors, conducting.T, axis=0).mean(axis=0)
    expected = (COULOMB + VISCOUS * RATE / TAU) / K / mean
    # The speed loop keeps the torque constant except for J dw/dt and a settling of 0.5 ms after each sector.
    middle = np.abs(np.degrees(2 * theta) / 60 - np.round(np.degrees(2 * theta) / 60)) < 0.3
    error = signals["current_A"][1000:] - expected
    assert rms(error[middle]) < 0.1 * rms(expected - expected.mean()) + (0.15 if model is REFERENCE else 0)


@EACH_MODEL
def test_phases_of_0_and_1_are_the_same_fault(model: Model) -> None:
    low, high = (
        record(model, Chirp(), faults=Faults(eccentricity=0.8, eccentricity_phase=k7), duration=0.1)[
            "current_A"
        ]
        for k7 in (0.0, 1.0)
    )
    # The sine of pi is 1e-16 in binary; switching may amplify it to the effect of half the step.
    assert rms(low - high) < (1e-9 if model is AVERAGED else 0.2)


@EACH_MODEL
@pytest.mark.parametrize("k8", [0.0, 1.0])
def test_the_gain_determines_the_following_error(model: Model, k8: float) -> None:
    signals = record(model, Ramp(RATE), faults=Faults(gain=k8), duration=0.4)
    lag = np.mean((RATE * (signals["time_s"] + INTERVAL / 2) - signals["position_rad"])[-500:])
    # The speed demand, G G_prop error, is the sum of the speed and k I / GAP by the torque.
    current = (COULOMB + VISCOUS * RATE / TAU) / K
    expected = (RATE / TAU + K * current / 5e-2) / ((0.5 + k8) * 1e5)
    # The command is taken at the start of a step and the position at its end.
    assert lag == pytest.approx(expected, abs=RATE * 1.1 * model.step + 0.02 * expected)


def regression(model: Model, faults: Faults, actuator: Actuator = THESIS) -> tuple[float, float]:
    """Return k [V·s/rad] and R [ohm] from a plain regression of the line voltage over the default chirp."""
    signals = record(model, Chirp(), actuator, faults=faults)
    current, speed = signals["current_A"], signals["speed_rad_s"]
    columns = np.stack([speed, current, np.gradient(current, INTERVAL)], axis=1)
    (k, resistance, _inductance), *_ = np.linalg.lstsq(columns, signals["voltage_V"])
    return float(k), float(resistance)


def test_the_line_voltage_identifies_k_and_r() -> None:
    k, resistance = regression(REFERENCE, Faults())
    assert k == pytest.approx(K, rel=1e-3)  # docs/physics.md, section 6: k to 0.1 %, R to 3 %
    assert resistance == pytest.approx(R_S, rel=3e-2)


def test_the_line_voltage_separates_heat_from_shorts() -> None:
    # Copper at 75 K more with weaker magnets, or a quarter of all turns shorted.
    hot = altered(electrical={"resistance": 1.3 * R_S}, motor={"torque_constant": 0.95 * K})
    hot_k, hot_r = regression(REFERENCE, Faults(), hot)
    short_k, short_r = regression(REFERENCE, Faults(short_a=0.25, short_b=0.25, short_c=0.25))
    assert hot_k / K == pytest.approx(0.95, abs=0.01)
    assert hot_r / R_S == pytest.approx(1.3, abs=0.04)
    assert short_k / K == pytest.approx(0.75, abs=0.01)
    assert short_r / R_S == pytest.approx(0.75, abs=0.03)


@pytest.mark.parametrize("model", [AVERAGED, MODELS["monitor"]], ids=["averaged", "monitor"])
def test_the_line_voltage_of_averaged_and_monitor_models_identifies_k_and_r(model: Model) -> None:
    k, resistance = regression(model, Faults())
    # The interval means use w and I at the ends of steps: 0.25 % and 0.5 % at 50 us, measured.
    assert k == pytest.approx(K, rel=5e-3)
    assert resistance == pytest.approx(R_S, rel=1e-2)


@pytest.mark.parametrize("model", [AVERAGED, MODELS["monitor"]], ids=["averaged", "monitor"])
def test_the_line_voltage_is_limited_to_the_supply(model: Model) -> None:
    signals = record(model, Sine(2e-2, 15.0), duration=0.1, interval=model.step)
    assert np.abs(signals["voltage_V"]).max() == pytest.approx(48.0, rel=1e-12)


def test_without_an_electrical_description_the_current_is_its_reference() -> None:
    ideal = altered(electrical=None)
    signals = record(AVERAGED, Sine(2e-2, 15.0), ideal, duration=0.1, interval=5e-5)
    assert np.array_equal(signals["current_A"], signals["reference_current_A"])
    assert np.abs(signals["current_A"]).max() == 22.5
    # With windings, the supply limits the rate of the current.
    slow = record(AVERAGED, Sine(2e-2, 15.0), duration=0.1, interval=5e-5)
    assert np.abs(slow["current_A"] - slow["reference_current_A"]).max() > 1


@pytest.mark.parametrize("name", ["inertia", "viscous", "coulomb", "static", "offset", "position_gain"])
def test_lumped_parameters_replace_those_of_the_actuator(name: str) -> None:
    changes = {
        "inertia": {"mechanics": {"inertia_motor": 3e-5, "inertia_user": 0.0}},
        "viscous": {"mechanics": {"viscous_motor": 1e-4, "viscous_user": 0.0}},
        "static": {"mechanics": {"static_friction_motor": 0.3, "static_friction_user": 0.0}},
        "offset": {"mechanics": {"offset": 0.04}},
        "position_gain": {"controller": {"position_gain": 7e4}},
        # Static friction keeps its ratio to dynamic friction, 2.
        "coulomb": {
            "mechanics": {
                "static_friction_motor": 0.2,
                "static_friction_user": 0.0,
                "dynamic_friction_motor": 0.1,
                "dynamic_friction_user": 0.0,
            }
        },
    }
    lumped_parameters = {
        "inertia": 3e-5,
        "viscous": 1e-4,
        "static": 0.3,
        "offset": 0.04,
        "position_gain": 7e4,
        "coulomb": 0.1,
    }
    k = Faults(friction=0.3, gain=0.8).vector
    inputs = Inputs.of(Chirp(), samples=1500, interval=INTERVAL, step=AVERAGED.step)
    by_parameter = run(AVERAGED, Plant.of(THESIS, k, {name: lumped_parameters[name]}), inputs)["current_A"]
    by_actuator = run(AVERAGED, Plant.of(altered(**changes[name]), k), inputs)["current_A"]
    nominal = run(AVERAGED, Plant.of(THESIS, k), inputs)["current_A"]
    np.testing.assert_allclose(by_parameter, by_actuator, rtol=1e-9, atol=1e-9)
    assert rms(by_parameter - nominal) > 1e-3


@pytest.mark.parametrize(
    ("name", "section", "key", "value"),
    [
        ("speed_gain", "controller", "speed_gain", 0.03),
        ("torque_constant", "motor", "torque_constant", 0.06),
        ("resistance", "electrical", "resistance", 4.0),
        ("inductance", "electrical", "inductance", 2e-3),
    ],
)
def test_electrical_lumped_parameters_replace_those_of_the_actuator(
    name: str, section: str, key: str, value: float
) -> None:
    inputs = Inputs.of(Sine(2e-2, 15.0), samples=500, interval=INTERVAL, step=AVERAGED.step)
    k = Faults(short_b=0.2).vector
    by_parameter = run(AVERAGED, Plant.of(THESIS, k, {name: value}), inputs)["current_A"]
    by_actuator = run(AVERAGED, Plant.of(altered(**{section: {key: value}}), k), inputs)["current_A"]
    assert np.array_equal(by_parameter, by_actuator)
    assert rms(by_parameter - run(AVERAGED, Plant.of(THESIS, k), inputs)["current_A"]) > 1e-3


def test_a_locked_shaft_does_not_move_with_any_faults() -> None:
    signals = record(
        REFERENCE, Chirp(), altered(mechanics=LOCKED), faults=Faults(0.2, 0.3, 0.5, 0.1, 0, 1, 0.2, 1)
    )
    assert not signals["speed_rad_s"].any()
    assert not signals["position_rad"].any()
