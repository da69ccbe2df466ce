"""The BLDC motor with six-step control by PWM: idle leg, commutation, power, and the averaged model."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Faults, Sine, Step
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, REFERENCE, Initial, Inputs, Model, Plant, simulate_batch
from emaphm.simulation.laws.idle_leg import diode_current, diode_voltage, outgoing_after
from emaphm.simulation.laws.pulse_width import half_ripple
from emaphm.simulation.models import motion
from simulation.rig import FREE, LOCKED, altered, record, rms, winding_energies

SIX_STEP = altered(Actuator.pmsm(), drive={"kind": "six-step"})
R_S, L_S, K_E, V_DC = 2.13, 7.2e-4, 0.0752, 48.0
PERIOD = 5e-5
BOTH = pytest.mark.parametrize("model", [REFERENCE, AVERAGED], ids=["reference", "averaged"])
FAULTY = Faults(0.3, 0.4, 0.2, 0.5, 0.1, 0.7, 0.2, 0.6)


def test_diodes_of_an_idle_leg_oppose_its_current_and_then_block() -> None:
    assert diode_voltage(2.0, 5.0, 24.0) == -24
    assert diode_voltage(-2.0, 5.0, 24.0) == 24
    assert diode_voltage(0.0, 5.0, 24.0) == 5
    assert diode_voltage(0.0, 31.0, 24.0) == 24  # the winding drives a current through the upper diode
    assert diode_current(0.01, -0.02, 5.0, 24.0) == 0
    assert diode_current(0.0, 1e-17, 5.0, 24.0) == 0  # a rounding error is no current
    assert diode_current(0.0, -0.02, 31.0, 24.0) == -0.02
    assert diode_current(0.03, 0.02, 5.0, 24.0) == 0.02


@BOTH
@pytest.mark.parametrize("sign", [1, -1])
def test_the_locked_rotor_current_settles_at_its_demand(model: Model, sign: int) -> None:
    held = altered(SIX_STEP, mechanics=LOCKED, controller={"current_limit": 2.0})
    start = Initial(rotor_offset=math.radians(30))
    signals = record(model, Step(sign * 1e-2), held, duration=0.01, interval=PERIOD, start=start)
    # The current is sampled where the ripple, 1.6 A peak to peak, passes its mean within R T / L / 12.
    rest = 0.02 if model is REFERENCE else 1e-4
    assert sign * signals["current_A"][-1] == pytest.approx(2.0, abs=rest)
    assert sign * signals["voltage_V"][-1] == pytest.approx(2.0 * R_S, abs=rest * R_S)
    # k_i Σ e T = R i over the samples; values of the averaged model are at the ends of its steps.
    area = np.sum(2.0 - sign * signals["current_A"]) * PERIOD
    assert area == pytest.approx(2.0 * (R_S / 3350.0 - PERIOD), abs=rest * 0.01 + 1e-5)


@pytest.mark.parametrize(
    ("held_A", "faults"),
    [(2.0, Faults()), (8.0, Faults()), (4.0, Faults(short_a=0.1, short_b=0.3, short_c=0.1))],
    ids=["small", "large", "shorted"],
)
def test_the_amplitude_of_the_ripple_agrees_with_the_averaged_model(held_A: float, faults: Faults) -> None:
    held = altered(SIX_STEP, mechanics=LOCKED, controller={"current_limit": held_A})
    start = Initial(rotor_offset=math.radians(30))
    signals = record(REFERENCE, Step(1e-2), held, duration=0.01, interval=1e-6, start=start, faults=faults)
    last = slice(-round(4 * PERIOD / 1e-6), None)
    phases = np.array([np.mean(signals[f"current_{phase}_A"][last]) for phase in "abc"])
    turns = np.array([1 - faults.short_a, 1 - faults.short_b, 1 - faults.short_c])
    inductance = L_S / 2 * np.sum(turns[np.abs(phases) > 1.0] ** 2)
    duty = np.mean(signals["voltage_V"][last]) / V_DC
    swing = half_ripple(V_DC, duty, PERIOD / (4 * inductance))
    # A period is 1/7 of L / R, or 1/5 with the shorts.
    assert np.ptp(signals["current_A"][last]) / 2 == pytest.approx(swing, rel=0.05)


@BOTH
@pytest.mark.parametrize("sign", [1, -1])
def test_the_no_load_speed_is_supply_over_back_emf_constant(model: Model, sign: int) -> None:
    unbraked = altered(
        SIX_STEP,
        mechanics=FREE,
        controller={"current_limit": 1e3, "speed_limit": None},
        motor={"torque_limit": None},
    )
    signals = record(model, Step(sign * 1e6), unbraked, duration=0.3)
    assert signals["speed_rad_s"][-1] == pytest.approx(sign * V_DC / K_E, rel=5e-3)


def test_the_idle_phase_has_no_current_except_during_commutation() -> None:
    signals = record(REFERENCE, Sine(8e-3, 15.0), SIX_STEP, duration=0.03, interval=1e-6)
    phases = np.stack([signals[f"current_{phase}_A"] for phase in "abc"])
    np.testing.assert_allclose(phases.sum(axis=0), 0, atol=1e-9)
    electrical = np.degrees(2 * signals["angle_rad"])
    from_edge = np.abs((electrical[None] - 120 * np.arange(3)[:, None] + 90) % 180 - 90)
    idle = from_edge < 29.9
    # Commutation takes the part of the idle time that is determined by the inductance.
    conducting = np.abs(phases[idle]) > 0
    assert 0 < conducting.mean() < 0.1
    for phase in range(3):
        ended = np.flatnonzero(np.diff(idle[phase].astype(int)) == -1)
        assert not np.any(phases[phase][ended])


@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_commutation_agrees_with_the_star_and_diode_by_another_integrator(speed: float) -> None:
    # 5 A flow from a to b when b is switched off and c on: the diode of b connects it to the upper rail.
    duty, emf, current = 0.3, K_E / 2 * speed, 5.0
    R, L = R_S / 2, L_S / 2
    legs = np.array([duty * V_DC / 2, V_DC / 2, -duty * V_DC / 2])
    back = np.array([emf, -emf, -emf])

    def slopes(_: float, i: Array) -> Array:
        d = legs - back - R * i
        return np.asarray((d - d.mean()) / L)

    def ended(_: float, i: Array) -> float:
        return float(i[1])

    ended.terminal = True  # type: ignore[attr-defined]
    solved = solve_ivp(slopes, (0, 1e-3), [current, -current, 0.0], events=ended, rtol=1e-9, atol=1e-10)
    duration, remaining = float(solved.t[-1]), float(solved.y[0, -1])
    # The averaged law: small steps of the fall, with the voltage of the pair.
    step = 1e-8
    fall = step * (1 - 1 / 3) / L
    outgoing, pair, time = current, current, 0.0
    while outgoing > 0:
        following, taken = (float(x) for x in outgoing_after(outgoing, V_DC / 2, emf, R, fall))
        driven = (duty * V_DC - 2 * emf - 2 * R * pair) / (2 * L) * step
        pair, outgoing, time = pair + driven - 0.5 * taken, following, time + step
    # First order, in steps of 1e-4 of the duration.
    assert time == pytest.approx(duration, rel=1e-3)
    assert pair == pytest.approx(remaining, rel=1e-3)


@pytest.mark.parametrize("faults", [Faults(), FAULTY], ids=["healthy", "faulty"])
def test_windings_conserve_power(faults: Faults) -> None:
    actuator = altered(SIX_STEP, motor={"torque_limit": None})
    signals = record(REFERENCE, Sine(8e-3, 15.0), actuator, faults=faults, duration=0.05, interval=1e-6)
    energies = winding_energies(signals, faults, R_S, L_S, 1e-6)
    # If a diode ends a current within a step, the rest of that step is in error: 1e-4 of the power, measured.
    assert energies.error < 3e-4
    assert energies.shaft > 0.1 * energies.supplied


def test_the_averaged_model_agrees_with_the_reference_model() -> None:
    drawn = np.random.default_rng(3).random((15, 8)) * [1, 1, 0.7, 0.7, 0.7, 1, 1, 1]
    k = np.vstack([Faults().vector, Faults(short_a=0.2).vector, drawn])

    def currents(model: Model) -> Array:
        inputs = Inputs.of(Chirp(), samples=2500, interval=2e-4, step=model.step)
        return simulate_batch(model, SIX_STEP, k, inputs)

    reference = currents(REFERENCE)
    differences = rms(currents(AVERAGED) - reference) / rms(reference)
    # Measured: 1.7 % healthy, 3.1 % without the effect of ripple on the breakaway; 2.5 and 6 % over all.
    # The rest is the instant of commutation within a step.
    assert differences[0] < 0.025
    assert differences[1] < 0.025
    assert np.median(differences) < 0.035


@pytest.mark.parametrize("actuator", [SIX_STEP, THESIS], ids=["six-step", "hysteresis"])
def test_a_disabled_drive_has_no_current(actuator: Actuator) -> None:
    def enabled(t: Array) -> Array:
        return (t < 0.02).astype(float)

    for model in (REFERENCE, AVERAGED):
        signals = record(model, Sine(8e-3, 15.0), actuator, duration=0.04, enabled=enabled)
        off = signals["time_s"] > 0.0201
        for name in ("current_A", "torque_Nm", "voltage_V"):
            assert np.any(signals[name][~off])
            assert not np.any(signals[name][off])


@BOTH
def test_with_a_disabled_drive_a_load_below_static_friction_does_not_move_the_shaft(model: Model) -> None:
    load = 0.9 * SIX_STEP.mechanics.static_friction
    signals = record(model, Step(0.0), SIX_STEP, duration=0.02, load=load, enabled=np.zeros_like)
    assert not np.any(signals["angle_rad"])


def test_a_lag_of_the_torque_removes_the_ripple_that_assists_the_breakaway() -> None:
    lagging = altered(SIX_STEP, motor={"torque_lag": 5e-4})
    signals = [
        record(model, Chirp(2e-3, stop_hz=5.0), lagging, duration=0.2, interval=1e-3)["current_A"]
        for model in (REFERENCE, AVERAGED)
    ]
    # Measured: 1 %, and 14 % if the ripple assists as without a lag.
    assert rms(signals[1] - signals[0]) < 0.03 * rms(signals[0])


@pytest.mark.parametrize("torque", [0.09, -0.09])
def test_on_a_compliant_shaft_the_ripple_acts_in_the_direction_of_the_shaft_torque(torque: float) -> None:
    soft = altered(SIX_STEP, transmission={"stiffness": 60.0, "damping": 2e-3})
    plant = Plant.of(soft, Faults().vector)
    step = AVERAGED.step_for(soft)
    p = SimpleNamespace(**{name: float(row[0]) for name, row in motion.parameters(plant, step).items()})
    rest = {name: float(row[0]) for name, row in motion.initial_state(plant, Initial()).items()}
    twisted = rest | {"angle": -np.sign(torque) * (p.half_gap + abs(torque) / p.stiffness), "output": 0.0}
    u = SimpleNamespace(load=0.0, step=step, time=0.0)
    moved = motion.motion(plant.structure)
    assert abs(torque) < p.static - p.user_static < abs(torque) + 0.06
    assert moved(SimpleNamespace(**twisted), p, u, 0.0, None)[0] == 0.0
    assert moved(SimpleNamespace(**twisted), p, u, 0.0, 0.06)[0] * torque > 0.0
