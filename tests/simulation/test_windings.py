"""Windings: closed forms, conservation of power, and the star equations by another integrator."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from emaphm.actuator import Faults, Sine, Step
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, MODELS, REFERENCE, Initial, Model, monitor
from emaphm.simulation.laws.equivalent_winding import winding_current
from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.star_windings import star_slopes
from simulation.rig import FREE, LOCKED, altered, record
from simulation.scalar_reference import trapezoid

EACH_MODEL = pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))

V_DC, R_S, L_S, K_E, J = 48.0, 2.13, 7.2e-4, 0.0752, 2.5e-5
HELD = altered(mechanics=LOCKED)
UNBRAKED = altered(
    mechanics=FREE,
    controller={"current_limit": 1e3, "speed_limit": None},
    motor={"torque_limit": None},
)


def rise(t: Array, resistance: float = R_S, inductance: float = L_S) -> Array:
    """Return the current [A] in a winding to which V_dc is applied at time 0."""
    return np.asarray(V_DC / resistance * -np.expm1(-t * resistance / inductance))


@EACH_MODEL
@pytest.mark.parametrize("electrical_degrees", [60, 120, 240])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_current_of_a_locked_rotor_rises_as_the_closed_form(
    model: Model, electrical_degrees: float, sign: int
) -> None:
    # Phases at the middle of their flats; the demand, 22.5 A, is not reached within three time constants.
    start = Initial(rotor_offset=math.radians(electrical_degrees) / 2)
    signals = record(
        model, Step(sign * 1e-2), HELD, duration=1e-3, interval=model.step, step=model.step, start=start
    )
    expected = sign * rise(signals["time_s"] + model.step)  # a row has the values at the end of its step
    # Explicit Euler (reference) has an error of at most V/R × step / (2 L/R) / e; the other models are exact.
    bound = V_DC / R_S * model.step * R_S / L_S / 2 / math.e * 1.01 if model is REFERENCE else 1e-12
    np.testing.assert_allclose(signals["current_A"], expected, rtol=0, atol=bound)
    assert not signals["speed_rad_s"].any()
    assert sign * signals["current_A"][-1] > 21


def test_the_euler_error_of_the_locked_rotor_halves_with_the_step() -> None:
    start = Initial(rotor_offset=math.radians(30))
    errors = []
    for step in (2e-6, 1e-6, 5e-7):
        signals = record(REFERENCE, Step(1e-2), HELD, duration=6e-4, interval=step, step=step, start=start)
        errors.append(np.abs(signals["current_A"] - rise(signals["time_s"] + step)).max())
    # The next order is step R/L / 2 = 0.3 % of the first.
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 2, rtol=0.01)


@pytest.mark.parametrize(
    ("model", "electrical_degrees", "turns", "squares"),
    [
        # Shorts 0.2, 0.4, 0.7 leave N = 0.8, 0.6, 0.3.
        (AVERAGED, 0, (0.6 + 0.3) / 2, (0.6**2 + 0.3**2) / 2),
        (AVERAGED, 60, (0.8 + 0.6) / 2, (0.8**2 + 0.6**2) / 2),
        (AVERAGED, 120, (0.8 + 0.3) / 2, (0.8**2 + 0.3**2) / 2),
        (monitor(), 0, 1.7 / 3, (1.7 / 3) ** 2),
        (monitor(), 60, 1.7 / 3, (1.7 / 3) ** 2),
        (monitor("modulated"), 0, 0.45, 0.45**2),
        (monitor("modulated"), 60, 0.7, 0.7**2),
        (monitor("modulated"), 120, 0.55, 0.55**2),
    ],
)
def test_the_current_of_a_shorted_winding_rises_as_the_closed_form(
    model: Model, electrical_degrees: float, turns: float, squares: float
) -> None:
    actuator = altered(mechanics=LOCKED, controller={"current_limit": 1e3})
    signals = record(
        model,
        Step(1e-2),
        actuator,
        faults=Faults(short_a=0.2, short_b=0.4, short_c=0.7),
        duration=1e-3,
        interval=model.step,
        start=Initial(rotor_offset=math.radians(electrical_degrees) / 2),
    )
    expected = rise(signals["time_s"] + model.step, R_S * turns, L_S * squares)
    np.testing.assert_allclose(signals["current_A"], expected, rtol=1e-11)  # rounding of 100 steps


@EACH_MODEL
@pytest.mark.parametrize("sign", [1, -1])
def test_the_no_load_speed_is_supply_over_back_emf_constant(model: Model, sign: int) -> None:
    signals = record(model, Step(sign * 1e6), UNBRAKED, duration=0.3)
    # The electromechanical time constant J R / k² is 9.4 ms: e⁻³² remains. In the reference model the idle
    # phase has ripple that adds torque on the ramps of its trapezoid: 0.1 % of the speed, measured.
    bound = 5e-3 if model is REFERENCE else 1e-9
    assert signals["speed_rad_s"][-1] == pytest.approx(sign * V_DC / K_E, rel=bound)
    assert abs(signals["reference_current_A"][-1]) == 1e3


@pytest.mark.parametrize("model", [AVERAGED, monitor()], ids=["averaged", "monitor"])
@pytest.mark.parametrize("short", [0.0, 0.4])
def test_the_speed_falls_linearly_with_the_torque(model: Model, short: float) -> None:
    turns, load = 1 - short, 0.2
    faults = Faults(short_a=short, short_b=short, short_c=short)
    signals = record(model, Step(1e6), UNBRAKED, faults=faults, load=load, duration=0.4)
    current = load / (K_E * turns)
    assert signals["current_A"][-1] == pytest.approx(current, rel=1e-9)
    assert signals["speed_rad_s"][-1] == pytest.approx(
        (V_DC - R_S * turns * current) / (K_E * turns), rel=1e-9
    )


def energies(step: float, faults: Faults) -> dict[str, float]:
    """Return the supplied, dissipated and stored energies over a run of the reference model [J]."""
    actuator = altered(motor={"torque_limit": None})
    signals = record(
        REFERENCE, Sine(8e-3, 15.0), actuator, faults=faults, duration=0.05, interval=step, step=step
    )
    turns = np.array([1 - faults.short_a, 1 - faults.short_b, 1 - faults.short_c])[:, None]
    after = np.stack([signals[f"current_{phase}_A"] for phase in "abc"])
    legs = np.stack([signals[f"voltage_{phase}_V"] for phase in "abc"])
    before = np.pad(after, ((0, 0), (1, 0)))[:, :-1]
    w = signals["speed_rad_s"]
    w_before = np.pad(w, (1, 0))[:-1]
    friction = 0.05 * 1.689 * (1 + 2 * faults.friction)
    viscous = 30 / math.pi * 1e-6 + 4.5e-7
    return {
        "supplied": float(np.sum(legs * (before + after) / 2) * step),
        "joule": float(np.sum(R_S / 2 * turns * ((before + after) / 2) ** 2) * step),
        "shaft": float(np.sum(signals["torque_Nm"] * (w + w_before) / 2) * step),
        "magnetic": float(np.sum(L_S / 4 * turns[:, 0] ** 2 * after[:, -1] ** 2)),
        "kinetic": J / 2 * float(w[-1]) ** 2,
        "dry": friction * float(np.sum(np.abs(w))) * step,
        "viscous": viscous * float(np.sum(w**2)) * step,
    }


FAULTY = Faults(0.3, 0.4, 0.2, 0.5, 0.1, 0.7, 0.2, 0.6)


@pytest.mark.parametrize("faults", [Faults(), FAULTY], ids=["healthy", "faulty"])
def test_windings_conserve_power(faults: Faults) -> None:
    e = energies(1e-6, faults)
    lost = e["supplied"] - e["joule"] - e["shaft"] - e["magnetic"]
    # With currents and speeds at the middle of each step, only second orders remain: 5e-7, measured. If
    # the constants of torque and back-EMF differed by 1e-3, the loss would be 1e-4.
    assert abs(lost) < 5e-6 * e["supplied"]
    assert e["shaft"] > 0.1 * e["supplied"]


@pytest.mark.parametrize("faults", [Faults(), FAULTY], ids=["healthy", "faulty"])
def test_the_shaft_conserves_power(faults: Faults) -> None:
    e = energies(1e-6, faults)
    # Friction at the start of the step times the mean speed of the step; a rest of one step at each reversal.
    assert e["kinetic"] + e["dry"] + e["viscous"] == pytest.approx(e["shaft"], rel=2e-5)
    assert e["viscous"] > 1e-3 * e["shaft"]


def solved(legs: Array, seconds: float, turns: Array, z: float, phi: float, rotor: float, w: float) -> Array:
    """Return the phase currents [A] after `seconds` from rest: the star of docs/physics.md, section 3."""
    R, L = R_S / 2 * turns, L_S / 2 * turns**2
    third = 2 * np.pi / 3 * np.arange(3)

    def slopes(t: float, i: Array) -> Array:
        theta = rotor + w * t
        K = K_E / 2 * turns * (1 + z * np.cos(theta + phi + third))
        s = np.array([trapezoid(float(np.degrees(2 * theta - shift))) for shift in third])
        # Four unknowns, v_n and three slopes, in one linear system.
        system = np.zeros((4, 4))
        system[:3, :3] = np.diag(L)
        system[:3, 3] = 1.0
        system[3, :3] = 1.0
        right = np.append(legs - R * i - K * s * w, 0.0)
        return np.asarray(np.linalg.solve(system, right)[:3])

    end = solve_ivp(slopes, (0, seconds), np.zeros(3), method="DOP853", rtol=1e-10, atol=1e-12)
    return np.asarray(end.y[:, -1])


@pytest.mark.parametrize("rotor", np.radians([20.0, 50.0, 80.0, 110.0, 140.0, 170.0]))
@pytest.mark.parametrize("w", [0.0, 300.0, -500.0])
def test_currents_between_switchings_agree_with_another_integrator(rotor: float, w: float) -> None:
    # With a wide hysteresis and a heavy rotor, legs and speed are constant for 60 us.
    actuator = altered(
        electrical={"hysteresis": 15.0},
        mechanics=FREE | {"inertia_motor": 1e9},
    )
    faults = Faults(short_a=0.1, short_b=0.3, short_c=0.5, eccentricity=1.0, eccentricity_phase=0.7)
    seconds = 60e-6
    after: list[Array] = []
    legs: list[Array] = []
    for step in (1e-6, 5e-7):
        signals = record(
            REFERENCE,
            Step(0.1),
            actuator,
            faults=faults,
            duration=seconds,
            interval=step,
            step=step,
            start=Initial(speed=w, rotor_offset=rotor),
        )
        voltages = np.stack([signals[f"voltage_{phase}_V"] for phase in "abc"])
        assert (voltages == voltages[:, :1]).all()
        assert np.abs(signals["speed_rad_s"] - w).max() < 1e-12
        legs.append(voltages[:, 0])
        after.append(np.stack([signals[f"current_{phase}_A"][-1] for phase in "abc"]))
    assert set(legs[0]) == {V_DC / 2, -V_DC / 2}
    turns = np.array([0.9, 0.7, 0.5])
    expected = solved(legs[0], seconds, turns, 0.42, 0.4 * np.pi, rotor, w)
    assert np.abs(expected).max() > 1
    # Error of Euler: step / 2 × t × d²i/dt², 3e-11 s² × V / L × R / L, with 1e-4 H and 6e3 /s of phase c.
    coarse, fine = after[0] - expected, after[1] - expected
    assert np.abs(coarse).max() < 5e-2
    assert np.abs(coarse).max() > 1e-4
    # First order: half the step, half the error; Richardson extrapolation leaves second order, 1e-3 of it.
    np.testing.assert_allclose(2 * fine - coarse, 0, atol=5e-3 * np.abs(coarse).max())


def test_the_currents_of_the_star_sum_to_0() -> None:
    rng = np.random.default_rng(5)
    drive, inverse = rng.normal(0, 30, (3, 50)), rng.uniform(1e3, 1e5, (3, 50))
    slopes = np.array([*star_slopes(Phases(*drive), Phases(*inverse), 1 / inverse.sum(axis=0))])
    np.testing.assert_allclose(slopes.sum(axis=0), 0, atol=1e-9 * np.abs(slopes).max())
    # The voltage of each leg minus that of its winding is the voltage of the centre, the same for all.
    centre = drive - slopes / inverse
    np.testing.assert_allclose(centre, centre[:1].repeat(3, axis=0), atol=1e-12 * np.abs(drive).max())


def test_the_current_of_a_winding_relaxes_exponentially() -> None:
    current = 5.0
    for _ in range(40):
        current = float(winding_current(current, 12.0, 1 / 3.0, math.exp(-1e-4 * 3.0 / 1e-3)))
    assert current == pytest.approx(4 + (5 - 4) * math.exp(-40 * 1e-4 * 3.0 / 1e-3), rel=1e-13)
