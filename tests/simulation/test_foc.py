"""The PMSM with field-oriented control, against an independent dq model and the star of its phases.

The dq model is from a textbook: amplitude-invariant dq values (S.-K. Sul: Control of electric machine drive
systems, 2011), flux ψ, phase resistance and inductance, solved by an adaptive Runge-Kutta method between the
samples of the controller. Line values of the package differ from it by factors √3 and 2/√3.
"""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from emaphm.actuator import Actuator, Chirp, Faults, Sine, Step
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, REFERENCE, Initial, Inputs, Model, Plant, observe_batch
from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.star_windings import star_currents_after, star_response
from simulation.rig import FREE, LOCKED, altered, record, rms, winding_energies

PMSM = Actuator.pmsm()
R_S, L_S, K_E, V_DC, POLES, J = 2.13, 7.2e-4, 0.0752, 48.0, 2, 2.5e-5
PERIOD = 5e-5
BOTH = pytest.mark.parametrize("model", [REFERENCE, AVERAGED], ids=["reference", "averaged"])
FAULTY = Faults(0.3, 0.4, 0.2, 0.5, 0.1, 0.7, 0.2, 0.6)


def dq_model(amplitude: float, hertz: float, periods: int) -> dict[str, Array]:
    """Return means over each PWM period for a healthy PMSM without friction that follows a sine.

    Position loop, speed loop and the controller of the currents are those of `Actuator.pmsm`.
    """
    psi, R, L = K_E / math.sqrt(3) / POLES, R_S / 2, L_S / 2
    kp, ki = 1.13 / 2, 3350.0 / 2  # per phase: V_line / I_line = 2 v / i
    limit = V_DC / math.sqrt(3)
    i_d = i_q = w = theta = x_d = x_q = 0.0
    applied = 0j  # phase voltage in the frame of the stator
    rows = []
    for n in range(periods):
        wanted_speed = 1e5 * (amplitude * math.sin(2 * math.pi * hertz * n * PERIOD) - theta / 500)
        wanted_speed = min(max(wanted_speed, -837.758), 837.758)
        line_current = min(max(0.0125 * (wanted_speed - w) / K_E, -22.5), 22.5)
        e_d, e_q = -i_d, 2 / math.sqrt(3) * line_current - i_q
        u = complex(kp * e_d + x_d, kp * e_q + x_q)
        v = u * min(1.0, limit / max(abs(u), 1e-12))
        if abs(u) <= limit or u.real * e_d <= 0:
            x_d += ki * e_d * PERIOD
        if abs(u) <= limit or u.imag * e_q <= 0:
            x_q += ki * e_q * PERIOD
        ahead = POLES * (theta + 1.5 * PERIOD * w)
        following = v * complex(math.cos(ahead), math.sin(ahead))

        def slopes(_: float, y: Array, held: complex = applied) -> list[float]:
            j_d, j_q, speed, angle = y[:4]
            back = held * complex(math.cos(POLES * angle), -math.sin(POLES * angle))
            electrical = POLES * speed
            torque = 1.5 * POLES * psi * j_q
            return [
                (back.real - R * j_d + electrical * L * j_q) / L,
                (back.imag - R * j_q - electrical * (L * j_d + psi)) / L,
                torque / J,
                speed,
                j_d,
                j_q,
                back.imag,
            ]

        start = [i_d, i_q, w, theta, 0.0, 0.0, 0.0]
        end = solve_ivp(slopes, (0, PERIOD), start, rtol=1e-9, atol=1e-12).y[:, -1]
        i_d, i_q, w, theta = (float(x) for x in end[:4])
        rows.append([*(end[4:] / PERIOD), w, theta])
        applied = following
    means = np.array(rows).T
    root3 = math.sqrt(3)
    return {
        "current_d_A": root3 / 2 * means[0],
        "current_q_A": root3 / 2 * means[1],
        "voltage_q_V": root3 * means[2],
        "speed_rad_s": means[3],
        "angle_rad": means[4],
    }


@pytest.mark.parametrize(("amplitude", "bound"), [(1e-3, 5e-4), (60e-3, 2.5e-3)], ids=["linear", "limited"])
def test_the_reference_model_agrees_with_the_dq_model(amplitude: float, bound: float) -> None:
    actuator = altered(PMSM, mechanics={**FREE, "backlash": 0.0}, motor={"torque_limit": None})
    periods = 800
    expected = dq_model(amplitude, 30.0, periods)
    signals = record(REFERENCE, Sine(amplitude, 30.0), actuator, duration=periods * PERIOD, interval=PERIOD)
    reached = np.hypot(signals["voltage_d_V"], signals["voltage_q_V"]).max()
    assert (reached > 0.99 * V_DC) == (amplitude > 1e-3)
    # Explicit Euler at 1 µs: R/L × step / 2 = 1.5e-3 of changes within a time constant.
    for name in ("current_d_A", "current_q_A", "voltage_q_V"):
        scale = np.abs(expected["current_q_A" if name != "voltage_q_V" else name]).max()
        np.testing.assert_allclose(signals[name], expected[name], rtol=0, atol=bound * scale, err_msg=name)
    # Means over a period are half a period earlier than the values at its end.
    middle = {name: (expected[name][1:] + expected[name][:-1]) / 2 for name in ("speed_rad_s", "angle_rad")}
    for name, values in middle.items():
        scale = np.abs(values).max()
        np.testing.assert_allclose(signals[name][1:], values, rtol=0, atol=bound * scale, err_msg=name)


@BOTH
def test_healthy_line_values_satisfy_the_equation_of_one_winding(model: Model) -> None:
    signals = record(model, Chirp(), PMSM, duration=0.1)
    np.testing.assert_allclose(
        K_E * signals["current_A"], signals["torque_Nm"], atol=2e-3 * signals["torque_Nm"].max()
    )
    np.testing.assert_array_equal(signals["current_A"], signals["current_q_A"])
    np.testing.assert_array_equal(signals["voltage_V"], signals["voltage_q_V"])
    # V = k w + R i + L di/dt + P w L i_d, for means over 200 µs; the slope is the difference of neighbours.
    slope = np.gradient(signals["current_A"], 2e-4)
    across = POLES * signals["speed_rad_s"] * L_S * signals["current_d_A"]
    voltage = K_E * signals["speed_rad_s"] + R_S * signals["current_A"] + L_S * slope + across
    assert rms(voltage - signals["voltage_V"]) < 0.02 * rms(voltage)
    assert np.abs(np.sum([signals[f"current_{phase}_A"] for phase in "abc"], axis=0)).max() < 1e-9


@BOTH
@pytest.mark.parametrize("sign", [1, -1])
def test_the_no_load_speed_is_supply_over_back_emf_constant(model: Model, sign: int) -> None:
    free = altered(
        PMSM,
        mechanics=FREE,
        controller={"current_limit": 1e3, "speed_limit": None},
        motor={"torque_limit": None},
    )
    signals = record(model, Step(sign * 1e6), free, duration=0.3)
    # The legs reach V_dc / √3 per phase, V_dc from line to line; the current in d takes a small part of it.
    assert signals["speed_rad_s"][-1] == pytest.approx(sign * V_DC / K_E, rel=1e-2)
    assert np.hypot(signals["voltage_d_V"], signals["voltage_q_V"]).max() < V_DC * 1.001


@BOTH
def test_the_locked_rotor_current_rises_with_the_bandwidth_of_its_loop(model: Model) -> None:
    held = altered(PMSM, mechanics=LOCKED, controller={"current_limit": 2.0})
    signals = record(model, Step(1e-2), held, duration=0.01, interval=PERIOD)
    assert signals["current_A"][-1] == pytest.approx(2.0, rel=1e-3)
    # In steady state the integral term supplies the current: k_i Σ e T = R i over the samples of the error;
    # means over a period are half a period later than the samples at its start.
    area = np.sum(2.0 - signals["current_A"]) * PERIOD
    assert area == pytest.approx(2.0 * (R_S / 3350.0 - PERIOD / 2), rel=0.01)
    assert signals["current_A"].max() < 2.0 * 1.01
    assert np.abs(signals["current_d_A"]).max() < 1e-3


def test_phases_of_the_reference_model_agree_with_the_star_by_another_integrator() -> None:
    step, steps, rotor = 1e-6, 500, 0.4
    start = Initial(speed=150.0, rotor_offset=rotor)
    signals = record(
        REFERENCE, Step(8e-3), PMSM, faults=FAULTY, duration=steps * step, interval=step, start=start
    )
    legs = np.stack([signals[f"voltage_{phase}_V"] for phase in "abc"])
    speed = np.append(150.0, signals["speed_rad_s"])
    angle = np.append(0.0, signals["angle_rad"]) + rotor
    turns, third = np.array([0.8, 0.5, 0.9]), 2 * np.pi / 3 * np.arange(3)
    R, L = R_S / 2 * turns, L_S / 2 * turns**2
    z, phi = 0.42 * 0.7, (2 * 0.2 - 1) * np.pi
    K = K_E / math.sqrt(3) * turns

    def slopes(t: float, i: Array, n: int) -> Array:
        w, theta = speed[n], angle[n] + speed[n] * t
        shape = (1 + z * np.cos(theta + phi + third)) * np.sin(POLES * theta - third)
        # Four unknowns, the voltage of the centre and three slopes, in one linear system.
        system = np.block([[np.diag(L), np.ones((3, 1))], [np.ones((1, 3)), np.zeros((1, 1))]])
        return np.asarray(np.linalg.solve(system, np.append(legs[:, n] - R * i - K * shape * w, 0.0))[:3])

    # A run that begins in motion has a current: the integration starts after the first step.
    current = np.array([signals[f"current_{phase}_A"][0] for phase in "abc"])
    for n in range(1, steps):
        current = solve_ivp(slopes, (0, step), current, args=(n,), rtol=1e-8, atol=1e-10).y[:, -1]
    final_currents = np.array([signals[f"current_{phase}_A"][-1] for phase in "abc"])
    assert np.abs(current).max() > 1
    # Explicit Euler: R/L × step / 2 of phase b is 0.3 % of changes within its time constant.
    np.testing.assert_allclose(final_currents, current, rtol=0, atol=5e-3 * np.abs(current).max())
    torque = np.sum(
        K * (1 + z * np.cos(angle[-2] + phi + third)) * np.sin(POLES * angle[-2] - third) * final_currents
    )
    assert signals["torque_Nm"][-1] == pytest.approx(torque, rel=1e-9)


@pytest.mark.parametrize("turns", [(1.0, 1.0, 1.0), (0.3, 1.0, 0.6), (0.3, 0.3, 0.3), (0.01, 1.0, 1.0)])
def test_the_star_response_is_exact_for_a_constant_voltage(turns: tuple[float, ...]) -> None:
    share = np.array(turns)
    R, L, step = R_S / 2 * share, L_S / 2 * share**2, 5e-5
    drive, before = np.array([20.0, -3.0, -11.0]), np.array([2.0, 1.5, -3.5])

    def slopes(_: float, i: Array) -> Array:
        d = drive - R * i
        return np.asarray((d - np.sum(d / L) / np.sum(1 / L)) / L)

    expected = solve_ivp(slopes, (0, step), before, rtol=1e-11, atol=1e-12, method="LSODA").y[:, -1]
    rows = {name: float(x[0]) for name, x in star_response(R[:, None], L[:, None], step).items()}
    currents = star_currents_after(Phases(*before), Phases(*drive), *rows.values())
    np.testing.assert_allclose([*currents], expected, rtol=1e-8)


@pytest.mark.parametrize("faults", [Faults(), FAULTY], ids=["healthy", "faulty"])
def test_windings_conserve_power(faults: Faults) -> None:
    actuator = altered(PMSM, motor={"torque_limit": None})
    signals = record(REFERENCE, Sine(8e-3, 15.0), actuator, faults=faults, duration=0.05, interval=1e-6)
    energies = winding_energies(signals, faults, R_S, L_S, 1e-6)
    assert energies.error < 1e-5
    assert energies.shaft > 0.1 * energies.supplied
    # The power from the values in d and q is the same.
    in_lines = (
        signals["voltage_d_V"] * signals["current_d_A"] + signals["voltage_q_V"] * signals["current_q_A"]
    )
    in_phases = sum(signals[f"voltage_{phase}_V"] * signals[f"current_{phase}_A"] for phase in "abc")
    assert np.sum(in_lines) == pytest.approx(np.sum(in_phases), rel=1e-9)


def distances(k: Array, actuator: Actuator = PMSM) -> Array:
    """Return the rms difference of the two models relative to the rms of the reference, (n, channels)."""
    channels = ("current_A", "voltage_V", "position_rad", "speed_rad_s")

    def observed(model: Model) -> Array:
        inputs = Inputs.of(Chirp(), samples=2500, interval=2e-4, step=model.step)
        return observe_batch(model, Plant.of(actuator, k), inputs, channels=channels)

    reference = observed(REFERENCE)
    return np.asarray(rms(observed(AVERAGED) - reference) / rms(reference))


def test_the_averaged_model_agrees_with_the_reference_model_except_for_ripple() -> None:
    drawn = np.random.default_rng(3).random((15, 8)) * [1, 1, 0.7, 0.7, 0.7, 1, 1, 1]
    differences = distances(np.vstack([Faults().vector, drawn]))
    # Sticking and motion have steps of 50 µs instead of 1 µs: 0.4 % of the healthy current, measured.
    assert differences[0, 0] < 0.006
    assert differences[0, 1] < 0.005
    assert np.median(differences[:, 0]) < 0.015
    assert differences.max() < 0.04


@pytest.mark.parametrize("frequency", [1e4, 4e4])
def test_the_averaged_model_has_the_delay_of_another_pwm_frequency(frequency: float) -> None:
    actuator = altered(PMSM, drive={"pwm_frequency": frequency})
    differences = distances(
        np.vstack([Faults().vector, Faults(short_a=0.3, eccentricity=0.5).vector]), actuator
    )
    assert differences[:, :2].max() < 0.015


@BOTH
def test_relabelling_the_phases_only_renames_their_channels(model: Model) -> None:
    # A third of an electrical turn is 60 deg of the rotor; the eccentricity is then half a turn away.
    k = np.array([0.3, 0.4, 0.1, 0.5, 0.3, 0.6, 0.15, 0.6])
    relabelled = k[[0, 1, 4, 2, 3, 5, 6, 7]]
    relabelled[6] = (k[6] + 0.5) % 1
    options = {"duration": 0.01, "interval": model.step}
    command = Sine(8e-3, 15.0)
    signals = record(
        model, command, PMSM, faults=Faults.from_vector(k), start=Initial(rotor_offset=0.4), **options
    )
    other = record(
        model,
        command,
        PMSM,
        faults=Faults.from_vector(relabelled),
        start=Initial(rotor_offset=0.4 + np.pi / 3),
        **options,
    )
    for name in ("current_A", "current_d_A", "voltage_V", "speed_rad_s", "torque_Nm"):
        scale = np.abs(signals[name]).max()
        np.testing.assert_allclose(other[name], signals[name], rtol=0, atol=1e-8 * scale, err_msg=name)
    np.testing.assert_allclose(other["current_b_A"], signals["current_a_A"], atol=1e-7)


@pytest.mark.parametrize(
    ("faults", "per_turn"),
    [(Faults(short_b=0.2), 2 * POLES), (Faults(eccentricity=0.5), 2 * POLES - 1)],
    ids=["short", "eccentricity"],
)
def test_a_fault_causes_torque_ripple_at_its_harmonic(faults: Faults, per_turn: int) -> None:
    # At constant current in q, shorts cause a harmonic 2 P per turn of the rotor, eccentricity 2 P - 1: the
    # part of N_i g_i sin(P θ - α_i) with a sum of 0 cancels in the star. Both have a direction.
    steady = altered(
        PMSM, mechanics={"inertia_motor": 1.0, "end_stops": None}, controller={"current_limit": 4.0}
    )
    signals = record(AVERAGED, Step(1e6), steady, faults=faults, start=Initial(speed=100.0), duration=0.2)
    rows = signals["time_s"] >= 0.2 - 2 * np.pi / 100
    gain = signals["torque_Nm"][rows] / signals["current_A"][rows]
    size = np.abs(np.fft.rfft(gain - gain.mean()))
    assert int(np.argmax(size)) == per_turn


def test_a_disabled_drive_has_no_current() -> None:
    def enabled(t: Array) -> Array:
        return (t < 0.02).astype(float)

    for model in (REFERENCE, AVERAGED):
        signals = record(model, Sine(8e-3, 15.0), PMSM, duration=0.04, enabled=enabled)
        off = signals["time_s"] > 0.0201
        for name in ("current_A", "current_d_A", "torque_Nm", "voltage_V"):
            assert np.any(signals[name][~off])
            assert not np.any(signals[name][off])
