"""Inverse dynamics against recordings of machines that `scipy.integrate.solve_ivp` integrates."""

import json
import math
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import cumulative_trapezoid, solve_ivp
from scipy.signal import butter, lfilter, sosfreqz

from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.arrays import Array
from emaphm.errors import MethodError, RecordingError
from emaphm.estimation.inverse_dynamics import (
    InverseDynamicsResult,
    controller_check,
    inverse_dynamics,
)
from emaphm.estimation.inverse_dynamics.controller_check import allowing_for_noise
from emaphm.estimation.inverse_dynamics.filtering import (
    FilterFrequencies,
    RowThinning,
    first_order_lag,
    low_pass,
)
from emaphm.estimation.inverse_dynamics.result import ParameterEstimate, with_parameters
from emaphm.estimation.inverse_dynamics.search import with_linear_solved
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.simulation import REFERENCE, Inputs, Plant, run
from emaphm.simulation.laws.sensors import sensed

RATE, DURATION = 1000.0, 5.0
INERTIA, VISCOUS, COULOMB = 0.8, 1.5, 2.0
TORQUE_CONSTANT = 0.5

Torque = Callable[[float, float], float]
"""Resisting torque [N·m] as a function of the user's position [rad] and speed [rad/s]."""

ACTUATOR = Actuator.from_dict(
    {
        "name": "bench",
        "controller": {
            "position_gain": 30.0,
            "speed_gain": 40.0,
            "current_limit": 1e4,
            "torque_constant": TORQUE_CONSTANT,
        },
        "motor": {"torque_constant": TORQUE_CONSTANT},
        "mechanics": {
            "inertia_motor": 0.3,
            "viscous_motor": 0.2,
            "static_friction_motor": 0.5,
            "dynamic_friction_motor": 0.5,
            "gear_ratio": 1.0,
        },
    }
)


def friction(speed: float) -> float:
    return VISCOUS * speed + COULOMB * math.tanh(speed / 1e-4)


def machine(
    resisting: Callable[[float, float, float], float],
    *,
    inertia: float = INERTIA,
    amplitude: float = 1.0,
    speed_gain: float = 40.0,
    duration: float = DURATION,
) -> Recording:
    """Return a recording of J dω/dt = τ - resisting(θ, ω, τ) under position and speed control."""

    def command(t: float) -> float:
        return amplitude * (math.sin(2 * math.pi * 0.5 * t) + 0.4 * math.sin(2 * math.pi * 1.3 * t + 1))

    def torque(t: float, position: float, speed: float) -> float:
        return speed_gain * (30.0 * (command(t) - position) - speed)

    def motion(t: float, state: Array) -> tuple[float, float]:
        position, speed = state.tolist()
        driving = torque(t, position, speed)
        return speed, (driving - resisting(position, speed, driving)) / inertia

    time = np.arange(0, duration, 1 / RATE)
    start = (command(0.0), 0.0)
    solved = solve_ivp(
        motion, (0, duration), start, t_eval=time, method="LSODA", rtol=1e-8, atol=1e-9, max_step=1e-2
    )
    driving = np.array([torque(*row) for row in zip(time.tolist(), *solved.y.tolist(), strict=True)])
    return Recording(
        {
            "time_s": time,
            "command_rad": np.array([command(t) for t in time.tolist()]),
            "position_rad": solved.y[0],
            "current_A": driving / TORQUE_CONSTANT,
        },
        "instant",
    )


def on_a_spring(position: float, speed: float, _: float) -> float:
    return friction(speed) + 3.0 * position + 0.7


@pytest.fixture(scope="module")
def plain() -> Recording:
    """Return a recording of a mass on a spring with viscous and Coulomb friction."""
    return machine(on_a_spring)


def check_values(found: Mapping[str, float], truth: Mapping[str, float], tolerance: float) -> None:
    for name, value in truth.items():
        assert found[name] == pytest.approx(
            value, rel=tolerance, abs=min(0.3, abs(value)) * tolerance or tolerance
        ), name


def check(result: InverseDynamicsResult, truth: Mapping[str, float], tolerance: float) -> None:
    check_values(result.values, truth, tolerance)


def check_gains(recording: Recording, actuator: Actuator) -> None:
    check, c = controller_check(recording, actuator), actuator.controller
    assert not check.contradicts
    assert check.position_gain is not None
    assert check.speed_gain is not None
    assert check.position_gain.value == pytest.approx(c.position_gain, rel=0.02)
    assert check.speed_gain.value == pytest.approx(c.speed_gain, rel=0.02)


SPRING = {"inertia": INERTIA, "viscous": VISCOUS, "coulomb": COULOMB, "offset": 0.7, "hinge": 3.0}


def test_parameters_of_a_mass_on_a_spring_are_estimated_from_its_motion(plain: Recording) -> None:
    # Friction changes sign within a row, and the low-pass spreads this over several rows: half a percent.
    result = inverse_dynamics(plain, ACTUATOR, list(SPRING))
    check(result, SPRING, 0.005)
    assert result.relative_error < 0.01
    assert result.collinear == ()
    replay = result.replays[0]
    assert replay.channel == "current_A"
    residual = replay.measured - replay.predicted
    assert np.linalg.norm(residual) / np.linalg.norm(replay.measured) == pytest.approx(result.relative_error)


def test_the_estimate_does_not_depend_on_the_controller(plain: Recording) -> None:
    other = with_lumped_parameters(ACTUATOR, {"position_gain": 200.0, "speed_gain": 5.0})
    known = inverse_dynamics(plain, ACTUATOR, list(SPRING))
    assert inverse_dynamics(plain, other, list(SPRING)).values == known.values


def test_the_estimate_does_not_depend_on_the_start(plain: Recording) -> None:
    far = with_lumped_parameters(ACTUATOR, {"inertia": 20.0, "viscous": 90.0, "coulomb": 60.0})
    check(inverse_dynamics(plain, far, list(SPRING)), SPRING, 0.005)


@pytest.mark.parametrize(("noise", "tolerance"), [(1e-4, 0.005), (1e-3, 0.02)])
def test_noise_of_the_position_causes_no_bias(plain: Recording, noise: float, tolerance: float) -> None:
    rng = np.random.default_rng(0)
    values = []
    for _ in range(5):
        position = plain["position_rad"] + noise * rng.standard_normal(plain.samples)
        noisy = Recording({**plain.channels, "position_rad": position}, "instant")
        values.append(inverse_dynamics(noisy, ACTUATOR, list(SPRING)).values)
    check_values(
        {name: float(np.mean([value[name] for value in values])) for name in SPRING}, SPRING, tolerance
    )


def test_standard_errors_account_for_correlated_residuals() -> None:
    plain, rng = machine(on_a_spring, duration=10.0), np.random.default_rng(0)
    deviations = []
    for _ in range(10):
        # A drift over some 0.1 s, as of friction along a screw: errors of white noise would be a third of it.
        white = rng.standard_normal(plain.samples)
        drift = 0.5 * lfilter([np.sqrt(1 - 0.99**2)], [1, -0.99], white)
        noisy = Recording({**plain.channels, "current_A": plain["current_A"] + drift}, "instant")
        result = inverse_dynamics(noisy, ACTUATOR, list(SPRING))
        deviations.append(
            [(result.values[name] - SPRING[name]) / result.standard_errors[name] for name in SPRING]
        )
    # The rms of 50 deviations, correlated in part, is within 0.3 of 1, and less where errors are wide.
    assert 0.6 < np.sqrt(np.mean(np.square(deviations))) < 1.3


@pytest.mark.parametrize(("size", "noise", "ratio"), [(0.0, 3.0, 0.5), (0.3, 0.02, 1.0)])
def test_repetitions_reduce_the_error_of_noise_and_not_that_of_unmodelled_friction(
    size: float, noise: float, ratio: float
) -> None:
    # A torque that depends on the position, with 30 periods per rad, is the same in each repetition.
    exact = machine(lambda position, speed, _: friction(speed) + size * math.sin(30 * position))
    rng, days = np.random.default_rng(1), []
    for _ in range(4):
        current = exact["current_A"] + noise * rng.standard_normal(exact.samples)
        days.append(Recording({**exact.channels, "current_A": current}, "instant"))
    free = ["inertia", "viscous", "coulomb"]

    def result_of(recordings: list[Recording]) -> InverseDynamicsResult:
        return inverse_dynamics(recordings, ACTUATOR, free, position_hz=40.0, regression_hz=20.0)

    joint, copies = result_of(days), result_of(days[:1] * 4)
    alone = [result_of([day]).standard_errors for day in days]
    assert (joint.error_correlation is None) == (size == 0)
    for name in free:
        single_error = np.sqrt(np.mean([errors[name] ** 2 for errors in alone]))
        # Each standard error is known to some 5 %.
        assert joint.standard_errors[name] / single_error == pytest.approx(ratio, abs=0.15)
        assert copies.standard_errors[name] / alone[0][name] == pytest.approx(1, abs=0.15)


def test_a_described_saturation_is_taken_into_account(plain: Recording) -> None:
    effective = plain["current_A"]
    saturation = 0.15 / float(np.max(np.abs(effective)))
    # i (1 - κ |i|) is the current that would make the torque without saturation.
    current = 2 * effective / (1 + np.sqrt(1 - 4 * saturation * np.abs(effective)))
    recording = plain.with_channels({**plain.channels, "current_A": current})
    described = Actuator.from_dict(
        {
            **ACTUATOR.model_dump(exclude_none=True),
            "motor": {"torque_constant": TORQUE_CONSTANT, "saturation": saturation},
        }
    )
    check(inverse_dynamics(recording, described, list(SPRING)), SPRING, 0.005)
    assert inverse_dynamics(recording, ACTUATOR, list(SPRING)).values["inertia"] > 1.03 * INERTIA


def test_described_sensor_errors_are_corrected(plain: Recording) -> None:
    sensors = {
        "current_A": {"scale": 0.05, "offset": 0.3, "lag": 4e-3},
        "position_rad": {"delay": 6.5e-3, "lag": 2e-3},
    }
    described = Actuator.from_dict({**ACTUATOR.model_dump(exclude_none=True), "sensors": sensors})
    shown = {
        name: sensed(plain[name], described.sensors.of(name), plain.interval_s) for name in plain.channels
    }
    recording = plain.with_channels(shown)
    check(inverse_dynamics(recording, described, list(SPRING)), SPRING, 0.005)
    check_gains(recording, described)
    # If the errors are not described, they bias the parameters and contradict the controller.
    assert inverse_dynamics(recording, ACTUATOR, list(SPRING)).values["inertia"] > 1.03 * INERTIA
    assert controller_check(recording, ACTUATOR).contradicts


def test_the_magnitude_of_a_current_is_refused(plain: Recording) -> None:
    sensors = {"current_A": {"unsigned": True}}
    described = Actuator.from_dict({**ACTUATOR.model_dump(exclude_none=True), "sensors": sensors})
    with pytest.raises(RecordingError, match="record 'current_A' with its sign"):
        inverse_dynamics(plain, described, list(SPRING))


def test_a_delay_as_long_as_the_recording_is_refused(plain: Recording) -> None:
    sensors = {"position_rad": {"delay": DURATION}}
    described = Actuator.from_dict({**ACTUATOR.model_dump(exclude_none=True), "sensors": sensors})
    with pytest.raises(MethodError, match=r"delay of 5 s shows nothing of recording, which has 5 s; correct"):
        inverse_dynamics(plain, described, list(SPRING))


def test_rows_at_a_single_reversal_are_kept_and_rows_of_sticking_are_omitted() -> None:
    moving = np.ones(1000, bool)
    moving[400:402] = False
    assert (
        RowThinning.of(moving, 20.0, 1e-3).kept.size
        == RowThinning.of(np.ones(1000, bool), 20.0, 1e-3).kept.size
    )
    moving[400:700] = False
    rows = RowThinning.of(moving, 20.0, 1e-3).kept
    assert not np.any((rows > 390) & (rows < 710))
    assert np.any(rows < 400)
    assert np.any(rows > 700)


def test_sticking_does_not_bias_friction() -> None:
    rows = 6000
    time = np.arange(rows) / RATE
    moving = (time // 1.5) % 2 == 0
    speed = np.where(moving, np.sin(2 * np.pi * 2 * time / 1.5) ** 2 * np.sin(2 * np.pi * time / 1.5), 0.0)
    position = cumulative_trapezoid(speed, dx=1 / RATE, initial=0)
    torque = INERTIA * np.gradient(speed, 1 / RATE) + VISCOUS * speed + COULOMB * np.sign(speed)
    torque = np.where(moving, torque, 1.3)  # held by static friction
    recording = Recording(
        {
            "time_s": time,
            "command_rad": position,
            "position_rad": position,
            "current_A": torque / TORQUE_CONSTANT,
        },
        "instant",
    )
    truth = {"inertia": INERTIA, "viscous": VISCOUS, "coulomb": COULOMB}
    result = inverse_dynamics(recording, ACTUATOR, [*truth, "offset"])
    check(result, {**truth, "offset": 0.0}, 0.05)
    assert result.replays[0].still_rows > 2900


def test_directional_friction_is_estimated() -> None:
    def unequal(_: float, speed: float, __: float) -> float:
        sign = math.tanh(speed / 1e-4)
        return VISCOUS * (1 + 0.2 * sign) * speed + COULOMB * (1 - 0.1 * sign) * sign

    recording = machine(unequal)
    truth = {
        "inertia": INERTIA,
        "viscous": VISCOUS,
        "viscous_asymmetry": 0.2,
        "coulomb": COULOMB,
        "coulomb_asymmetry": -0.1,
    }
    check(inverse_dynamics(recording, ACTUATOR, list(truth)), truth, 0.01)


def test_a_constant_load_and_a_coulomb_asymmetry_are_refused_as_collinear(plain: Recording) -> None:
    with pytest.raises(MethodError, match="offset and coulomb_asymmetry act alike"):
        inverse_dynamics(plain, ACTUATOR, ["inertia", "viscous", "coulomb", "offset", "coulomb_asymmetry"])


def test_gravity_and_its_angle_are_estimated() -> None:
    recording = machine(lambda position, speed, _: friction(speed) + 4.0 * math.sin(position + 0.3))
    truth = {"inertia": INERTIA, "viscous": VISCOUS, "coulomb": COULOMB, "gravity": 4.0, "gravity_angle": 0.3}
    check(inverse_dynamics(recording, ACTUATOR, list(truth)), truth, 0.01)


def test_quadratic_friction_and_torque_ripple_are_estimated() -> None:
    recording = machine(
        lambda position, speed, _: (
            friction(speed)
            + 0.3 * speed * abs(speed)
            - 0.4 * math.cos(7 * position)
            - 0.2 * math.sin(7 * position)
        )
    )
    truth = {
        "inertia": INERTIA,
        "viscous": VISCOUS,
        "coulomb": COULOMB,
        "quadratic": 0.3,
        "ripple1_cos": 0.4,
        "ripple1_sin": 0.2,
    }
    cogging = Actuator.from_dict({**ACTUATOR.model_dump(exclude_none=True), "ripple": [{"order": 7}]})
    result = inverse_dynamics(recording, cogging, list(truth))
    check(result, truth, 0.02)
    assert result.identified.ripple[0].cos == result.values["ripple1_cos"]


def test_a_stribeck_curve_and_its_speed_are_estimated() -> None:
    def stribeck(_: float, speed: float, __: float) -> float:
        level = COULOMB + 1.5 * math.exp(-((speed / 0.5) ** 2))
        return VISCOUS * speed + level * math.tanh(speed / 1e-4)

    truth = {"inertia": INERTIA, "viscous": VISCOUS, "coulomb": COULOMB, "static": 3.5, "stribeck_speed": 0.5}
    result = inverse_dynamics(machine(stribeck, speed_gain=80.0), ACTUATOR, list(truth))
    # Few rows lie on the slope of the curve, and the low-pass rounds its peak at each reversal.
    check(result, truth, 0.03)
    assert result.at_bound == ()


def test_the_transition_speed_of_smooth_friction_is_estimated() -> None:
    recording = machine(lambda _, speed, __: VISCOUS * speed + COULOMB * math.tanh(speed / 0.3))
    truth = {"inertia": INERTIA, "viscous": VISCOUS, "coulomb": COULOMB, "transition_speed": 0.3}
    check(inverse_dynamics(recording, ACTUATOR, list(truth)), truth, 0.01)


def test_a_value_that_would_be_negative_is_0_and_at_its_bound() -> None:
    # A torque drives the shaft in proportion to its speed, as no friction can.
    recording = machine(lambda _, speed, __: COULOMB * math.tanh(speed / 0.3) - 0.2 * speed)
    result = inverse_dynamics(recording, ACTUATOR, ["inertia", "viscous", "coulomb", "transition_speed"])
    assert result.values["viscous"] == 0.0
    assert result.at_bound == ("viscous",)
    assert result.identified.mechanics.viscous == 0.0


def test_static_friction_is_estimated_no_lower_than_coulomb_friction() -> None:
    def falling(_: float, speed: float, __: float) -> float:
        level = COULOMB * (1 - 0.5 * math.exp(-((speed / 0.5) ** 2)))
        return VISCOUS * speed + level * math.tanh(speed / 1e-4)

    recording, plain = machine(falling, speed_gain=80.0), ["inertia", "viscous", "coulomb"]
    result = inverse_dynamics(recording, ACTUATOR, [*plain, "static", "stribeck_speed"])
    # Without a peak at low speed, the law adds nothing to Coulomb friction.
    check(result, inverse_dynamics(recording, ACTUATOR, plain).values, 1e-4)
    assert result.values["static"] == pytest.approx(result.values["coulomb"], rel=1e-4)
    assert result.standard_errors["stribeck_speed"] > result.values["stribeck_speed"]
    assert result.identified.mechanics.static_friction >= result.values["coulomb"]


def test_a_parameter_with_almost_no_effect_leaves_the_others_finite() -> None:
    columns = np.stack([np.linspace(-1.0, 1.0, 50), np.full(50, 1e-310)], axis=1)
    problem: Any = SimpleNamespace(
        jacobian=lambda _, linear: columns[:, linear], residual=lambda point: columns @ ([2.0, 0.0] - point)
    )
    solution = with_linear_solved(
        problem, np.array([0.0, 1.0]), np.array([True, True]), np.zeros(2), np.full(2, np.inf)
    )
    assert np.isfinite(solution).all()
    assert solution[0] == pytest.approx(2.0)


def test_a_solution_at_its_bounds_does_not_exceed_them() -> None:
    rng = np.random.default_rng(0)
    lower, upper = np.full(2, 0.1), np.full(2, 0.7)
    for _ in range(100):
        columns = rng.normal(size=(5, 2)) * 10 ** rng.uniform(-3, 3, 2)
        problem: Any = SimpleNamespace(
            jacobian=lambda *_, rows=columns: rows,
            residual=lambda point, rows=columns: rows @ (np.array([-1.0, 2.0]) - point),
        )
        solution = with_linear_solved(problem, np.full(2, 0.4), np.full(2, True), lower, upper)
        assert np.all((solution >= lower) & (solution <= upper))


def test_friction_per_motor_torque_and_per_external_torque_is_estimated() -> None:
    def loaded(position: float, speed: float, torque: float) -> float:
        load = 4.0 * math.sin(position)
        level = COULOMB + abs(0.2 * torque + 0.3 * load)
        return VISCOUS * speed + load + level * math.tanh(speed / 1e-4)

    truth = {
        "inertia": INERTIA,
        "viscous": VISCOUS,
        "coulomb": COULOMB,
        "gravity": 4.0,
        "load_motor": 0.2,
        "load_external": 0.3,
    }
    recording = machine(loaded)
    check(inverse_dynamics(recording, ACTUATOR, list(truth)), truth, 0.03)
    # The same friction, described mostly per torque between motor and load.
    tied = dict(truth)
    tied |= {"load_friction": tied.pop("load_motor"), "load_external": 0.1}
    check(inverse_dynamics(recording, ACTUATOR, list(tied)), tied, 0.03)


def test_recordings_are_fitted_jointly_with_known_values_of_each() -> None:
    # Two known masses on the same machine; the torque constant of the second day is 10 % lower.
    light = machine(lambda _, speed, __: friction(speed) + 0.5)
    heavy = machine(lambda _, speed, __: friction(speed) - 0.2, inertia=1.6)
    weak = Recording({**heavy.channels, "current_A": heavy["current_A"] / 0.9}, "instant", "weak")
    result = inverse_dynamics(
        [light, weak],
        ACTUATOR,
        ["viscous", "coulomb", "offset", "torque_constant"],
        known=[{"inertia": INERTIA}, {"inertia": 1.6}],
        per_recording=["offset", "torque_constant"],
    )
    check(result, {"viscous": VISCOUS, "coulomb": COULOMB}, 0.01)
    assert result.replays[0].values["offset"] == pytest.approx(0.5, abs=0.01)
    assert result.replays[1].values["offset"] == pytest.approx(-0.2, abs=0.01)
    assert result.replays[1].values["torque_constant"] == pytest.approx(0.9 * TORQUE_CONSTANT, rel=0.01)
    assert result.covariance.shape == (2, 2)


def test_a_torque_constant_is_estimated_where_the_inertia_is_known(plain: Recording) -> None:
    known = with_lumped_parameters(ACTUATOR, {"inertia": INERTIA, "torque_constant": 2.0})
    free = ["viscous", "coulomb", "offset", "hinge", "torque_constant"]
    check(inverse_dynamics(plain, known, free), {"torque_constant": TORQUE_CONSTANT, "hinge": 3.0}, 0.01)
    with pytest.raises(MethodError, match="act alike"):
        inverse_dynamics(plain, known, ["inertia", *free])


def test_a_voltage_may_replace_the_current(plain: Recording) -> None:
    resistance = 2.0
    speed = np.gradient(plain["position_rad"], 1 / RATE)
    voltage = TORQUE_CONSTANT * speed + resistance * plain["current_A"]
    channels = {name: plain[name] for name in ("time_s", "command_rad", "position_rad", "current_A")}
    recording = Recording({**channels, "voltage_V": voltage}, "instant")
    electrical = Actuator.thesis().electrical
    assert electrical is not None
    driven = ACTUATOR.model_copy(
        update={"electrical": electrical.model_copy(update={"resistance": resistance})}
    )
    result = inverse_dynamics(recording, driven, list(SPRING), channel="voltage_V")
    assert result.replays[0].channel == "voltage_V"
    check(result, SPRING, 0.01)


def test_parameters_of_the_reference_model_are_estimated() -> None:
    actuator = Actuator.thesis()
    m = actuator.mechanics
    recording = simulate(actuator, Chirp(), faults=Faults(gain=0.3))
    result = inverse_dynamics(recording, actuator, ["inertia", "viscous", "coulomb"])
    assert result.values["inertia"] == pytest.approx(m.inertia, rel=0.01)
    assert result.values["coulomb"] == pytest.approx(m.dynamic_friction, rel=0.01)
    assert abs(result.values["viscous"] - m.viscous) < 3 * result.standard_errors["viscous"]


def test_the_result_has_an_actuator_a_table_and_json(plain: Recording) -> None:
    result = inverse_dynamics(plain, ACTUATOR, list(SPRING))
    assert result.identified.mechanics.inertia == pytest.approx(result.values["inertia"])
    assert result.identified.mechanics.hinge == pytest.approx(result.values["hinge"])
    answer = json.loads(result.to_json())
    assert answer["recordings"][0]["regression_hz"] == result.replays[0].frequencies.regression_hz
    assert "inertia" in str(result)
    assert "Hz" in str(result)


@pytest.mark.parametrize(
    ("free", "message"),
    [
        ([], "no parameter is free"),
        (["inertja"], "did you mean 'inertia'"),
        (["inertia", "stribeck_load_motor"], "no recording shows stribeck_load_motor"),
    ],
)
def test_parameters_that_cannot_be_estimated_are_refused(
    plain: Recording, free: list[str], message: str
) -> None:
    with pytest.raises(MethodError, match=message):
        inverse_dynamics(plain, ACTUATOR, free)


def test_unsuitable_recordings_are_refused(plain: Recording) -> None:
    with pytest.raises(MethodError, match="no recording"):
        inverse_dynamics([], ACTUATOR, ["inertia"])
    bare = {name: plain[name] for name in ("time_s", "command_rad", "current_A")}
    with pytest.raises(RecordingError, match="record 'position_rad'"):
        inverse_dynamics(Recording(bare), ACTUATOR, ["inertia"])
    still = Recording({**plain.channels, "position_rad": np.zeros(plain.samples)})
    with pytest.raises(RecordingError, match="never moves"):
        inverse_dynamics(still, ACTUATOR, ["inertia"])
    with pytest.raises(MethodError, match="half the sample rate"):
        inverse_dynamics(plain, ACTUATOR, ["inertia"], position_hz=900.0)
    with pytest.raises(MethodError, match="known values of 1 recordings for 2"):
        inverse_dynamics([plain, plain], ACTUATOR, ["inertia"], known=[{}])


def test_the_low_pass_is_a_butterworth_filter_applied_in_both_directions() -> None:
    time = np.arange(4000) / RATE
    for frequency in (5.0, 10.0, 20.0, 40.0):
        wave = np.sin(2 * np.pi * frequency * time)
        passed = low_pass(wave, 20.0, 1 / RATE)[1000:3000]
        _, gain = sosfreqz(butter(4, 20.0, fs=RATE, output="sos"), [frequency], fs=RATE)
        # The magnitude is squared, and the phase is zero.
        assert passed == pytest.approx(abs(gain[0]) ** 2 * wave[1000:3000], abs=1e-3)


def test_the_lag_is_exact_for_straight_lines() -> None:
    time = np.arange(50).astype(np.float64) * 1e-3
    lag = 3e-3
    expected = 2.0 * (time - lag * (1 - np.exp(-time / lag)))
    assert first_order_lag(2.0 * time, lag, 1e-3) == pytest.approx(expected, abs=1e-12)
    assert first_order_lag(time, 0.0, 1e-3) is time
    assert first_order_lag(5.0 + 2.0 * time, lag, 1e-3) == pytest.approx(5.0 + expected, abs=1e-12)


def test_the_cutoff_falls_with_the_noise() -> None:
    time = np.arange(20_000) / RATE
    rng = np.random.default_rng(0)
    cutoffs = []
    for noise in (1e-3, 3e-3, 1e-2):
        white = noise * rng.standard_normal(time.size)
        # A triangle: its spectrum falls with the fourth power of the frequency.
        frequencies = FilterFrequencies.of(np.arcsin(np.sin(2 * np.pi * time)) + white, 1 / RATE)
        cutoffs.append(frequencies.position_hz)
        measured = np.gradient(low_pass(white, frequencies.position_hz, 1 / RATE), 1 / RATE)[2000:-2000]
        assert frequencies.speed_noise == pytest.approx(np.std(measured), rel=0.25)
    assert cutoffs == sorted(cutoffs, reverse=True)
    assert cutoffs[0] > cutoffs[-1]


def test_the_controller_check_estimates_the_actual_gains(plain: Recording) -> None:
    check = controller_check(plain, ACTUATOR)
    assert not check.contradicts
    assert check.position_gain is not None
    assert check.speed_gain is not None
    assert check.position_gain.value == pytest.approx(30.0, rel=0.01)
    assert check.speed_gain.value == pytest.approx(40.0, rel=0.01)
    assert check.relative_error < 0.05


@pytest.mark.parametrize("gains", [{"position_gain": 36.0}, {"speed_gain": 20.0}])
def test_gains_that_contradict_a_recording_are_detected(plain: Recording, gains: dict[str, float]) -> None:
    assert controller_check(plain, with_lumped_parameters(ACTUATOR, gains)).contradicts


@pytest.mark.parametrize(("amplitude", "count"), [(0.1, 1e-3), (0.1, 5e-3), (0.02, 3e-4), (0.02, 1e-3)])
def test_a_position_in_coarse_counts_does_not_contradict_the_gains(amplitude: float, count: float) -> None:
    exact = machine(on_a_spring, amplitude=amplitude)
    columns = {name: exact[name] for name in exact.names}
    rounded = columns | {"position_rad": count * np.round(columns["position_rad"] / count)}
    result = controller_check(Recording(rounded, "instant"), ACTUATOR)
    assert not result.deviating
    for gain, truth in ((result.position_gain, 30.0), (result.speed_gain, 40.0)):
        assert gain is not None
        assert abs(gain.value - truth) < 2 * gain.standard_error


@given(noise=st.floats(0.0, 5.0), error=st.floats(0.0, 0.1))
def test_the_error_of_a_gain_covers_its_bias_by_noise(noise: float, error: float) -> None:
    estimate, noisier = (ParameterEstimate(40.0 / (1 + i * noise), error, "-") for i in (1, 2))
    allowed = allowing_for_noise(estimate, noisier)
    assert allowed is not None
    assert allowed.standard_error == pytest.approx(math.hypot(error, 40.0 - estimate.value), abs=1e-9)


def test_a_deviating_gain_has_the_unit_of_the_coordinates(plain: Recording) -> None:
    other = with_lumped_parameters(ACTUATOR, {"speed_gain": 20.0})
    for coordinates, unit in (("rotary", "N·m·s/rad"), ("linear", "N·s/m")):
        (text,) = controller_check(plain, other.model_copy(update={"coordinates": coordinates})).deviating
        assert f" {unit}, described 20" in text


def test_only_a_fault_of_the_gain_contradicts_the_controller() -> None:
    actuator = Actuator.thesis()
    for faults in (Faults(), Faults(friction=0.8), Faults(backlash=0.8), Faults(short_a=0.5)):
        assert not controller_check(simulate(actuator, Chirp(), faults=faults), actuator).contradicts
    assert controller_check(simulate(actuator, Chirp(), faults=Faults(gain=0.25)), actuator).contradicts


@pytest.mark.parametrize("feedforward", [0.0, 0.5])
def test_the_controller_check_filters_the_command(feedforward: float) -> None:
    actuator = with_lumped_parameters(
        Actuator.dc(), {"command_lag": 5e-3, "speed_feedforward": feedforward, "backlash": 0.0}
    )
    check_gains(simulate(actuator, Chirp()), actuator)


def test_the_controller_check_uses_the_rows_where_the_drive_is_on() -> None:
    actuator = with_lumped_parameters(
        Actuator.dc(), {"speed_gain": 5e-3, "integral_gain": 0.5, "position_integral_gain": 5.0}
    )
    inputs = Inputs.of(
        Chirp(),
        samples=2500,
        interval=2e-4,
        step=1e-5,
        enabled=lambda t: np.where((t > 0.3) & (t < 0.4), 0.0, 1.0),
    )
    measured = run(REFERENCE, Plant.of(actuator, Faults().vector), inputs)
    names = ("position_rad", "speed_rad_s", "current_A")
    driving = {"command_rad": inputs.rows(inputs.command), "enabled": inputs.rows(inputs.enabled)}
    recorded = {"time_s": inputs.time_s, **driving, **{name: measured[name] for name in names}}
    check_gains(Recording(recorded), actuator)
    with pytest.raises(RecordingError, match="the drive is never on"):
        controller_check(Recording(recorded | {"enabled": np.zeros(2500)}), actuator)


LAWS: dict[str, dict[str, float]] = {
    "ripple under a swinging load": {
        "gravity": 0.1,
        "gravity_angle": 0.4,
        "coulomb_asymmetry": 0.2,
        "ripple1_cos": 0.03,
        "ripple1_sin": 0.02,
    },
    "smooth friction on a spring": {
        "offset": 0.05,
        "hinge": 0.04,
        "transition_speed": 5.0,
        "quadratic": 1e-5,
    },
    "load-dependent Stribeck": {
        "gravity": 0.2,
        "gravity_angle": 0.4,
        "load_motor": 0.1,
        "load_external": 0.2,
        "static": 0.17,
        "stribeck_speed": 10.0,
        "stribeck_load_motor": 0.1,
        "stribeck_load_external": 0.3,
    },
}


@pytest.mark.parametrize("law", LAWS)
def test_laws_of_the_reference_model_are_estimated(law: str) -> None:
    # Signs and forms of the laws are checked against the simulation, whose drive switches three phases.
    thesis = Actuator.thesis().model_dump(exclude_none=True)
    thesis["mechanics"] |= {"gear_ratio": 0.1, "end_stops": None, "backlash": 0.0}
    thesis["controller"] |= {"position_gain": 2000.0}
    bare = Actuator.from_dict(
        {**thesis, **({"ripple": [{"order": 4}]} if "ripple1_cos" in LAWS[law] else {})}
    )
    actuator = with_parameters(bare, LAWS[law])
    # Stribeck friction per load is identified at reversals only, so that more reversals are needed.
    duration, rate = (2.0, 5000.0) if "stribeck_load_motor" in LAWS[law] else (1.5, 2500.0)
    chirp = Chirp(amplitude=1.0, stop_hz=3.0, duration=duration)
    recording = simulate(actuator, chirp, duration=duration, sample_rate=rate)
    result = inverse_dynamics(recording, bare, ["inertia", "coulomb", *LAWS[law]])
    assert result.relative_error < 0.01
    assert result.values["inertia"] == pytest.approx(actuator.mechanics.inertia, rel=0.01)
    assert result.values["coulomb"] == pytest.approx(actuator.mechanics.dynamic_friction, rel=0.01)
    # Friction through standstill is a rational curve within 2.4 % of the hyperbolic tangent.
    check_values(result.values, LAWS[law], 0.04)
    assert result.at_bound == ()


@pytest.mark.parametrize("seed", [1, 2])
def test_unmeasured_backlash_does_not_contradict_the_gains(seed: int) -> None:
    actuator = Actuator.thesis()
    whole = simulate(actuator, Chirp(amplitude=1e-3), noise=0.05, seed=seed)
    columns = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "position_rad")}
    recording = Recording(columns, whole.sampling)
    assert not controller_check(recording, actuator).gains_contradict
    other = with_lumped_parameters(actuator, {"position_gain": 1.3 * actuator.controller.position_gain})
    assert controller_check(recording, other).gains_contradict
