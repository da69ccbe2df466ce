"""The foreign plant: compared with the reference model without its features, and with closed forms."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from emaphm import simulated_recording
from emaphm.actuator import Actuator, Chirp, Faults, Step
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.arrays import Array
from emaphm.recording import Recording
from emaphm.study import Plan
from emaphm.study.foreign_plant import (
    _parameters,
    back_emf,
    commutation,
    move,
    shaft_torque,
    simulate,
    stribeck_torque,
)
from emaphm.study.rig import BackEmf, Bristles, Shaft, Stribeck
from emaphm.study.rig import ForeignFeatures as Features
from simulation.rig import FREE, altered, rms

THESIS = Actuator.thesis()
CHIRP = Chirp()
BRIEF = Chirp(duration=0.2)
"""The same frequency range; 200,000 steps are enough to compare two implementations of the same steps."""
STEP = 1e-6
MIXED = Faults(0.3, 0.4, 0.1, 0.25, 0.0, 0.35, 0.2, 0.4)
CASES = {
    "healthy": Faults(),
    "mixed": MIXED,
    "multiple": Faults(0.25, 0.75, 0.8, 0.8, 0.8, 0.25, 0.5, 0.75),
}
EACH = {
    rig.label: rig.foreign
    for rig in Plan.load("plants").rigs
    # Late commutation changes no more than chaos does; a test below checks it to rounding.
    if rig.foreign is not None and rig.label.endswith("strong") and not rig.foreign.commutation_delay
}
SHAFT = Shaft(stiffness=61.6, damping=1.96e-3)
FRICTION = Stribeck(speed=20.0, smoothing=1.0)
BRISTLES = Bristles(bend=0.02, speed=20.0)


def assert_same_but_for_rounding(recording: Recording, expected: Recording) -> None:
    """Compare all channels of both recordings."""
    for name in recording.names:
        # Two implementations of the same step differ only by rounding, unless this decides a switching: then
        # they diverge as stated in docs/physics.md, section 3, but not within these fifths of a second.
        np.testing.assert_allclose(
            recording[name], expected[name], rtol=0, atol=1e-9 * np.abs(expected[name]).max(), err_msg=name
        )


@pytest.mark.parametrize("case", CASES)
def test_the_plant_without_features_is_the_reference_model(case: str) -> None:
    actuator = with_lumped_parameters(THESIS, {"offset": 0.07, "supply": 46.0, "inertia": 2.7e-5})
    options: dict[str, Any] = {"faults": CASES[case], "duration": BRIEF.duration}
    ours = simulate(actuator, BRIEF, Features(), **options)
    theirs = simulated_recording.simulate(actuator, BRIEF, **options)
    assert_same_but_for_rounding(ours, theirs)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(
    ("features", "lag"),
    [
        ({"hall": (5.0, -3.0, 2.0)}, {}),
        ({"hall": (-4.0, 0.0, 2.0), "hall_hysteresis": 3.0}, {"commutation_lag": math.radians(3.0)}),
        ({"commutation_delay": 5e-5}, {"commutation_delay": 5e-5}),
    ],
    ids=["hall", "hysteresis", "delay"],
)
def test_the_plant_with_commutation_errors_is_the_reference_model_with_these_laws(
    case: str, features: dict[str, Any], lag: dict[str, float]
) -> None:
    early = zip("abc", features.get("hall", (0.0, 0.0, 0.0)), strict=True)
    motor = {f"hall_{name}": math.radians(degrees) for name, degrees in early}
    sensed = altered(THESIS, motor=motor, drive={"kind": "hysteresis"} | lag)
    options: dict[str, Any] = {"faults": CASES[case], "duration": BRIEF.duration}
    ours = simulate(THESIS, BRIEF, Features(**features), **options)
    theirs = simulated_recording.simulate(sensed, BRIEF, **options)
    assert_same_but_for_rounding(ours, theirs)


def test_the_plant_starts_at_the_origin_of_the_command() -> None:
    # An integer number of motor turns, so that the phases are the same as at 0.
    about = 20 * 2 * np.pi * THESIS.mechanics.gear_ratio
    displaced, centred = (
        simulate(THESIS, Chirp(duration=0.05, about=start), Features(), faults=MIXED, duration=0.05)
        for start in (about, 0.0)
    )
    np.testing.assert_allclose(displaced["position_rad"] - about, centred["position_rad"], rtol=0, atol=1e-6)
    assert np.abs(displaced["current_A"]).max() == pytest.approx(np.abs(centred["current_A"]).max(), rel=0.1)


@pytest.mark.parametrize("rate", [1e3, 3e3, 2e4])
def test_the_plant_is_sampled_like_the_reference_model(rate: float) -> None:
    options: dict[str, Any] = {"faults": MIXED, "duration": 0.05, "sample_rate": rate}
    noisy: dict[str, Any] = options | {"noise": 0.05, "adc_bits": 12, "seed": 3}
    for with_options in (options, noisy):
        ours = simulate(THESIS, CHIRP, Features(), **with_options)
        theirs = simulated_recording.simulate(THESIS, CHIRP, **with_options)
        for name in ours.names:
            np.testing.assert_allclose(ours[name], theirs[name], rtol=1e-9, atol=1e-9, err_msg=name)


@pytest.fixture(scope="module")
def mixed() -> Array:
    """Return the current of the reference model with `MIXED`."""
    return simulated_recording.simulate(THESIS, BRIEF, faults=MIXED, duration=BRIEF.duration)["current_A"]


@pytest.mark.parametrize("name", EACH)
def test_each_feature_changes_the_result_of_the_reference_model(name: str, mixed: Array) -> None:
    foreign = simulate(THESIS, BRIEF, EACH[name], faults=MIXED, duration=BRIEF.duration)["current_A"]
    # Halving the reference model's step changes 0.1 A (docs/physics.md, section 3); the lag changes least.
    assert rms(foreign - mixed) > 0.1
    assert np.all(np.isfinite(foreign))


def test_features_have_the_reference_model_as_their_limit() -> None:
    # The limits: friction with almost no slope that reverses within a tenth of a rad/s, without its own
    # static level; bristles that hardly bend; a shaft of 5 kHz without gap; sensors as fast as the step; a
    # trapezoid and Hall sensors a hundredth of a degree off.
    plain = altered(
        mechanics={
            "static_friction_motor": THESIS.mechanics.dynamic_friction_motor,
            "static_friction_user": THESIS.mechanics.dynamic_friction_user,
            "backlash": 0.0,
        }
    )
    stiff = Shaft(stiffness=6160.0, damping=1.96e-2)
    brief: dict[str, Any] = {"duration": BRIEF.duration}
    reference = simulated_recording.simulate(plain, BRIEF, **brief)["current_A"]
    # The difference caused by chaos in a run with perturbed switching.
    shaken = simulated_recording.simulate(plain, BRIEF, controller_noise=1e-3, **brief)["current_A"]
    chaos = rms(shaken - reference)
    steep = Features(friction=Stribeck(speed=20.0, smoothing=0.1))
    brush = Features(friction=Bristles(bend=1e-6, speed=20.0))
    angles = Features(back_emf=BackEmf(flat=120.01, sine=1e-4), hall=(0.01, -0.01, 0.01))
    for features in (steep, brush, Features(shaft=stiff), Features(sensor_lag=1e-7), angles):
        assert rms(simulate(plain, BRIEF, features, **brief)["current_A"] - reference) < 1.5 * chaos


def test_friction_has_its_two_levels_and_no_jump() -> None:
    torque = [stribeck_torque(w, 0.17, 0.08, 20.0, 1.0) for w in (0.0, 5.0, 20.0, 1e3, -1e3)]
    expected = [
        0.0,
        (0.08 + 0.09 * math.exp(-1 / 16)) * math.tanh(5),
        0.08 + 0.09 / math.e,  # the tanh is 1 to 1e-17
        0.08,
        -0.08,
    ]
    np.testing.assert_allclose(torque, expected, rtol=1e-12, atol=0)


def test_bristles_act_as_a_spring_at_rest_and_slide_at_their_level() -> None:
    m, bend = THESIS.mechanics, BRISTLES.bend
    static = m.static_friction_motor + m.static_friction_user
    actuator = altered(mechanics={"viscous_motor": 0.0, "viscous_user": 0.0})
    level = Features(friction=Bristles(bend=bend, speed=1e6, damping=2.0))
    held = _moved(level, actuator, (0.0,) * 4, lambda _: 0.3 * static, 150_000)
    # Moving one way, bristles that bend by z slide as z' = w (1 - z / bend): the angle is its integral.
    assert held[-1, 1] == pytest.approx(-bend * math.log(1 - 0.3), rel=1e-4)
    assert abs(held[-1, 0]) < 1e-6
    # At 100 rad/s, five Stribeck speeds, a damper takes what is above the dynamic level.
    dynamic = m.dynamic_friction_motor + m.dynamic_friction_user
    braked = altered(mechanics={"viscous_motor": 2e-2, "viscous_user": 0.0})
    start = (100.0, 0.0, 100.0, 0.0)
    slid = _moved(Features(friction=BRISTLES), braked, start, lambda _: dynamic + 2.0, 25_000)
    assert slid[-1, 0] == pytest.approx(100.0, rel=1e-6)


@pytest.mark.parametrize(
    ("flat", "sine"), [(120.0, 0.0), (60.0, 0.0), (100.0, 0.0), (140.0, 0.3), (120.0, 1.0)]
)
def test_a_back_emf_has_its_peak_line_to_line(flat: float, sine: float) -> None:
    angles = np.radians(np.arange(0.0, 360.0, 0.5))
    ramp = math.radians(180 - flat) / 2
    phase = np.array([back_emf(angle, ramp, sine) for angle in angles])
    lagging = np.roll(phase, 240)
    assert np.max(phase - lagging) == pytest.approx(2.0, rel=1e-12)
    np.testing.assert_allclose(phase[360:], -phase[:360], rtol=0, atol=1e-12)
    if sine == 0:
        assert np.count_nonzero(np.abs(phase) > 1 - 1e-12) == 4 * flat + 2


def test_each_commutation_edge_is_as_early_as_its_hall_sensor() -> None:
    hall = (5.0, -3.0, 2.0)
    sign = np.empty((720, 3))
    for n in range(720):
        commutation(math.radians(n / 2 + 0.25), np.radians(hall), 0.0, np.zeros(3), sign[n])
    for phase in range(3):
        on, off = 30 + 120 * phase - hall[phase], 30 + 120 * (phase + 1) - hall[(phase + 1) % 3]
        there = (np.arange(720) / 2 + 0.25 - on) % 360
        np.testing.assert_array_equal(sign[:, phase] > 0, there < off - on)
        there = (there - 180) % 360
        np.testing.assert_array_equal(sign[:, phase] < 0, there < off - on)


def test_the_shaft_pushes_only_beyond_its_gap() -> None:
    assert shaft_torque(0.9e-3, 5.0, 1e-3, 60.0, 1e-3) == 0.0
    assert shaft_torque(3e-3, 0.0, 1e-3, 60.0, 1e-3) == pytest.approx(0.12)
    assert shaft_torque(-3e-3, -2.0, 1e-3, 60.0, 1e-3) == pytest.approx(-0.122)
    # Parting so fast that the damper would pull.
    assert shaft_torque(1.1e-3, -100.0, 1e-3, 60.0, 1e-3) == 0.0
    assert shaft_torque(-1.1e-3, 100.0, 1e-3, 60.0, 1e-3) == 0.0


def _moved(
    features: Features, actuator: Actuator, start: tuple[float, ...], torque: Any, steps: int
) -> Array:
    """Return (w, theta, user w, user angle) after each step, shape (steps, 4)."""
    p = _parameters(actuator, Faults(), features, STEP)
    state, trace, bend = start, np.empty((steps, 4)), np.zeros(3)
    for n in range(steps):
        state = move(p, torque(n * STEP), *state, bend, STEP)
        trace[n] = state
    return trace


def test_the_two_inertias_oscillate_at_their_natural_frequency() -> None:
    actuator = altered(mechanics=FREE | {"backlash": 0.0})
    undamped = Features(shaft=Shaft(stiffness=SHAFT.stiffness, damping=0.0))
    trace = _moved(undamped, actuator, (0.0, 1e-3, 0.0, 0.0), lambda _: 0.0, 10_000)
    m = actuator.mechanics
    omega = math.sqrt(SHAFT.stiffness * (1 / m.inertia_motor + 1 / m.inertia_user))
    assert omega == pytest.approx(2 * math.pi * 500, rel=1e-3)
    t = (np.arange(10_000) + 1) * STEP
    twist = trace[:, 1] - trace[:, 3]
    # The error of symplectic Euler is the phase of a step, omega × step / 2, and its square.
    np.testing.assert_allclose(twist, 1e-3 * np.cos(omega * t), rtol=0, atol=1e-3 * omega * STEP)
    momentum = m.inertia_motor * trace[:, 0] + m.inertia_user * trace[:, 2]
    assert np.abs(momentum).max() < 1e-12 * m.inertia_motor * np.abs(trace[:, 0]).max()


@pytest.mark.parametrize("friction", [FRICTION, BRISTLES], ids=["smooth", "bristles"])
def test_motion_with_gap_spring_damper_and_friction_agrees_with_another_integrator(
    friction: Stribeck | Bristles,
) -> None:
    actuator = with_lumped_parameters(altered(mechanics={"end_stops": None}), {"offset": 0.05})
    m, shaft = actuator.mechanics, SHAFT

    def torque(t: float) -> float:
        return 0.6 * math.sin(2 * math.pi * 60 * t)

    def brake(w: float, bend: float, inertia: float, static: float, dynamic: float) -> tuple[float, float]:
        """Return the friction and the rate of bristle deflection."""
        level = dynamic + (static - dynamic) * math.exp(-((w / friction.speed) ** 2))
        if isinstance(friction, Stribeck):
            return level * math.tanh(w / friction.smoothing), 0.0
        stiffness = static / friction.bend
        rate = w - stiffness * abs(w) / level * bend
        return stiffness * bend + 2 * friction.damping * math.sqrt(stiffness * inertia) * rate, rate

    def slopes(t: float, y: Array) -> list[float]:
        w, theta, user_w, user, *bend = y
        beyond = theta - user - float(np.clip(theta - user, -m.backlash / 2, m.backlash / 2))
        passed = shaft.stiffness * beyond + shaft.damping * (w - user_w) if beyond else 0.0
        passed = passed if passed * beyond > 0 else 0.0
        braked = brake(w, bend[0], m.inertia_motor, m.static_friction_motor, m.dynamic_friction_motor)
        motor = torque(t) - passed - m.viscous_motor * w - braked[0]
        held = brake(user_w, bend[1], m.inertia_user, m.static_friction_user, m.dynamic_friction_user)
        load = passed - m.offset - m.viscous_user * user_w - held[0]
        return [motor / m.inertia_motor, w, load / m.inertia_user, user_w, braked[1], held[1]]

    steps = 20_000
    simulated = _moved(Features(friction=friction, shaft=shaft), actuator, (0.0,) * 4, torque, steps)
    end = solve_ivp(slopes, (0, steps * STEP), np.zeros(6), max_step=1e-5, rtol=1e-9, atol=1e-12).y[:4, -1]
    # A step is 3e-3 rad of the shaft's oscillation, and Euler's error here is a tenth of this, as measured.
    largest = np.abs(simulated).max(axis=0)
    np.testing.assert_allclose(simulated[-1] / largest, end / largest, rtol=0, atol=1e-3)


def test_sensors_lag_like_a_first_order_system() -> None:
    # Locked, at rest, phases b and c: 48 V are laid on R and L, the current follows an exponential, and a
    # first-order sensor shows its convolution.
    held = altered(mechanics={"static_friction_motor": 1e3})
    e = held.electrical
    assert e is not None
    lag, winding, final = 5e-5, e.inductance / e.resistance, e.supply / e.resistance
    rows = 200
    options: dict[str, Any] = {"duration": rows * STEP, "sample_rate": 1 / STEP}
    simulated = simulate(held, Step(1e-2), Features(sensor_lag=lag), **options)
    t = (np.arange(rows) + 1) * STEP
    expected = final * (1 - (winding * np.exp(-t / winding) - lag * np.exp(-t / lag)) / (winding - lag))
    # At an electrical angle of 0, b and c are on their flats and a idles: -b = c carry the current.
    np.testing.assert_allclose(simulated["current_A"], expected, rtol=0, atol=final * STEP / lag)
    true = simulate(held, Step(1e-2), Features(), **options)
    np.testing.assert_allclose(true["current_A"], final * -np.expm1(-t / winding), rtol=0, atol=0.05)
