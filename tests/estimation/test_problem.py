"""Inputs of a model: command and load reconstructed from a recording, compared channels, initial state."""

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cases import HEALTHY, INTERVAL, THESIS, USUAL
from emaphm.actuator import Actuator, Chirp, Faults, Sampled, Sine
from emaphm.arrays import Array
from emaphm.diagnosis import diagnose, error_percent
from emaphm.errors import MethodError
from emaphm.estimation import driving_signals
from emaphm.estimation.posing import problem_of
from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.initial_state import initial_state
from emaphm.recording import Recording, acquire
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED, REFERENCE, Initial, Inputs, Plant, run
from emaphm.simulation.laws.sensors import sensed

RATIO = THESIS.mechanics.gear_ratio
LARGEST_GAP = 0.05
"""Backlash of the thesis's actuator at k2 = 1, full width at the motor [rad]."""

ROWS = 400
TIME: Array = np.asarray(np.arange(ROWS) * INTERVAL)


def recorded(sampling: Any = "mean", **columns: Array) -> Recording:
    """Return a recording with a sinusoidal current and the given columns; the default command is 1 mrad."""
    given = {"time_s": TIME, "command_rad": np.full(ROWS, 1e-3), "current_A": np.sin(30 * TIME)}
    return Recording(given | columns, sampling)


def interval_means(signal: Any) -> Array:
    """Return the means of a function of time over the recording's intervals, by Gauss's rule."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    t = TIME[:, np.newaxis] + INTERVAL / 2 * (1 + nodes)
    return np.asarray(signal(t) @ weights / 2)


def steps_of(problem: Problem) -> Array:
    """Return the times [s] at which the model reads its inputs, shape (samples × substeps,)."""
    return np.asarray(np.arange(problem.inputs.command.size) * problem.inputs.step)


CHIRP = Chirp(duration=ROWS * INTERVAL)
FINE: Array = np.linspace(0, ROWS * INTERVAL, 20_001)
CURVATURE = float(np.abs(np.gradient(np.gradient(CHIRP(FINE), FINE), FINE)).max())
"""Largest second derivative of the chirp [rad/s²]."""


def test_the_command_is_reconstructed_from_interval_means_beyond_its_curvature() -> None:
    problem = problem_of(recorded(command_rad=interval_means(CHIRP)), THESIS)
    t = steps_of(problem)
    errors = np.abs(problem.inputs.command - CHIRP(t))
    # A mean differs from its midpoint by h² c''/24, a chord from its curve by h² c''/8: lines through
    # the means have an error of h² c''/6.
    assert errors.max() < INTERVAL**2 * CURVATURE / 6 / 50


def test_a_jump_of_the_command_is_not_overshot() -> None:
    def jump(t: Array) -> Array:
        return np.asarray(np.where(t < TIME[200], 1e-3, 3e-3))

    problem = problem_of(recorded(command_rad=jump(TIME)), THESIS)
    t, command = steps_of(problem), problem.inputs.command
    far = np.abs(t - TIME[200]) > 2 * INTERVAL
    np.testing.assert_allclose(command[far], jump(t)[far], rtol=0, atol=1e-12)
    # Except for the term h²/24 of the second difference at the jump.
    assert command.min() > 1e-3 - 2e-3 / 20
    assert command.max() < 3e-3 + 2e-3 / 20


@pytest.mark.parametrize("sampling", ["mean", "instant"])
@settings(max_examples=20)
@given(rate=st.floats(-1, 1), start=st.floats(-0.4, 0.4), since=st.floats(-50, 50))
def test_a_ramp_is_reconstructed_exactly_at_any_start_of_the_clock(
    sampling: str, rate: float, start: float, since: float
) -> None:
    def ramp(t: Array) -> Array:
        return start + 1e-3 + rate * t

    rows = interval_means(ramp) if sampling == "mean" else ramp(TIME)
    problem = problem_of(recorded(sampling, time_s=np.asarray(since + TIME), command_rad=rows), THESIS)
    t = steps_of(problem)
    exact = ramp(np.minimum(t, TIME[-1]) if sampling == "instant" else t)
    # Rounding of times of some 50 s changes an interval of 0.2 ms by 1e-11, over 400 rows.
    np.testing.assert_allclose(problem.inputs.command, exact, rtol=0, atol=1e-9)


def test_instants_are_interpolated_by_a_smooth_curve_through_the_rows() -> None:
    rows = CHIRP(TIME)
    problem = problem_of(recorded("instant", command_rad=rows), THESIS)
    by_row = problem.inputs.command.reshape(ROWS, -1)
    np.testing.assert_allclose(by_row[:, 0], rows, rtol=0, atol=1e-12)
    between = CHIRP(TIME[:-1] + INTERVAL / 2)
    np.testing.assert_allclose(by_row[:-1, 2], between, rtol=0, atol=INTERVAL**2 * CURVATURE / 8 / 50)


def test_a_recorded_load_is_reconstructed_like_the_command() -> None:
    def load(t: Array) -> Array:
        return 0.05 * np.sin(40 * t)

    problem = problem_of(recorded(load_Nm=interval_means(load)), THESIS)
    errors = np.abs(problem.inputs.load - load(steps_of(problem)))
    assert errors.max() < INTERVAL**2 * 0.05 * 40**2 / 6 / 50
    assert not np.any(problem_of(recorded(), THESIS).inputs.load)


def test_a_recorded_switch_is_held_over_each_row() -> None:
    enabled = np.where(np.arange(ROWS) < 120, 1.0, 0.0)
    driving = problem_of(recorded(enabled=enabled), THESIS).driving
    assert driving.enabled is not None
    t = steps_of(problem_of(recorded(), THESIS))
    np.testing.assert_array_equal(driving.enabled(t), np.repeat(enabled, t.size // ROWS))
    assert problem_of(recorded(), THESIS).driving.enabled is None


def test_a_switched_off_drive_has_no_torque() -> None:
    enabled = np.where(np.arange(ROWS) < 120, 1.0, 0.0)
    swing = 5e-3 * np.sin(2 * np.pi * 15 * TIME)
    problem = problem_of(recorded("instant", command_rad=swing, enabled=enabled), THESIS)
    torque = problem.signals(HEALTHY)["torque_Nm"]
    assert np.abs(torque[:120]).max() > 0.1
    np.testing.assert_array_equal(torque[120:], 0.0)


# Compared channels.


def test_a_recorded_current_is_the_primary_channel() -> None:
    sine = np.sin(30 * TIME)
    problem = problem_of(recorded(position_rad=1e-3 * sine, voltage_V=sine), THESIS, channels=None)
    assert problem.channels == ("current_A", "voltage_V", "position_rad")
    assert (problem.primary, problem.recorded.tolist()) == ("current_A", sine.tolist())
    assert problem_of(recorded(position_rad=sine), THESIS).channels == ("current_A",)


def test_without_a_current_the_first_varying_channel_is_primary() -> None:
    columns = {"time_s": TIME, "command_rad": np.full(ROWS, 1e-3), "position_rad": 1e-3 * np.sin(30 * TIME)}
    idle = Recording(columns | {"voltage_V": np.zeros(ROWS)})
    problem = problem_of(idle, THESIS, channels=None)
    assert problem.channels == ("position_rad",)
    np.testing.assert_array_equal(problem.recorded, idle["position_rad"])
    # Without an electrical description, no model has a voltage.
    ideal = THESIS.model_copy(update={"electrical": None})
    moving = Recording(columns | {"voltage_V": np.sin(30 * TIME)})
    assert problem_of(moving, THESIS, channels=None).channels == ("voltage_V", "position_rad")
    assert problem_of(moving, ideal, channels=None).channels == ("position_rad",)
    # No channel of a jammed actuator varies, but it is compared.
    jammed = Recording(columns | {"position_rad": np.zeros(ROWS)})
    assert problem_of(jammed, THESIS, channels=None).channels == ("position_rad",)


@pytest.mark.parametrize("name", ["current_A", "voltage_V", "position_rad", "speed_rad_s"])
def test_the_primary_channel_is_predicted_alone_as_with_all_channels(shorted: Recording, name: str) -> None:
    problem = problem_of(shorted, THESIS, channels=None)
    alone = problem_of(shorted, THESIS, channels=(name,)).predict_primary(SHORT.vector)
    np.testing.assert_array_equal(alone, problem.predict(SHORT.vector)[:, problem.channels.index(name)])


@pytest.mark.parametrize("method", ["hybrid", "random"])
def test_a_diagnosis_of_all_faults_needs_a_current(shorted: Recording, method: str) -> None:
    names = ("time_s", "command_rad", "position_rad", "speed_rad_s")
    columns = {name: shorted[name] for name in names} | {"Current_A": shorted["current_A"]}
    with pytest.raises(MethodError) as caught:
        diagnose(Recording(columns, source="rig 3"), THESIS, method=method)
    for piece in (
        "rig 3",
        "needs a current",
        "position_rad",
        "did you mean 'Current_A'?",
        "record current_A",
    ):
        assert piece in str(caught.value)


def test_a_diagnosis_without_a_current_lists_unused_columns(shorted: Recording) -> None:
    names = ("time_s", "command_rad", "position_rad")
    columns = {name: shorted[name] for name in names} | {"load": np.zeros(shorted.samples)}
    with pytest.raises(MethodError, match=r"only position_rad \(columns not used: load\); record"):
        diagnose(Recording(columns), THESIS)


# Initial state.


def test_a_small_zero_error_of_the_position_starts_within_the_end_stops() -> None:
    mechanics = THESIS.mechanics.model_copy(update={"end_stops": (0.0, 1.0)})
    retracted = THESIS.model_copy(update={"mechanics": mechanics})

    def out(t: Array) -> Array:
        return 2.5e-3 * (1 - np.cos(12 * np.pi * t))

    whole = simulate(retracted, out, model="averaged", noise=0.05, adc_bits=14)
    columns = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")}
    shown = Recording(columns | {"position_rad": whole["position_rad"] - 1e-3})
    assert problem_of(shown, retracted).start.angle == 0
    wrong = Recording(columns | {"position_rad": whole["position_rad"] - 0.05})
    with pytest.raises(MethodError, match=r"starts at -0.0\d+, beyond the actuator's end stops"):
        problem_of(wrong, retracted).signals(HEALTHY)


def test_a_recording_at_rest_starts_on_the_command() -> None:
    rest = np.full(ROWS, 1e-3)
    start = initial_state(recorded(position_rad=rest, speed_rad_s=0 * rest, angle_rad=rest / RATIO), THESIS)
    assert start.angle == pytest.approx(0.5)
    assert (start.speed, start.rotor_offset) == (0.0, 0.0)


def test_without_a_position_the_user_starts_on_the_command() -> None:
    start = initial_state(recorded(), THESIS)
    assert start == Initial(angle=1e-3 / RATIO)


@pytest.mark.parametrize("sampling", ["mean", "instant"])
def test_a_moving_command_starts_at_its_value_at_time_0(sampling: str) -> None:
    def sine(t: Array) -> Array:
        return np.asarray(5e-3 * np.sin(20 * np.pi * t))

    rows = interval_means(sine) if sampling == "mean" else sine(TIME)
    start = initial_state(recorded(sampling, command_rad=rows), THESIS)
    # Two means of a straight line identify it exactly, and a sine is straight at 0 to the square of
    # 20 pi × INTERVAL, 2e-4; the error of the first mean itself is a thousand times the bound.
    assert abs(start.angle) * RATIO < 1e-3 * 20 * np.pi * 5e-3 * INTERVAL / 2


def test_a_position_away_from_the_command_is_the_start() -> None:
    start = initial_state(recorded(position_rad=np.full(ROWS, 0.1), angle_rad=np.full(ROWS, 50.02)), THESIS)
    assert start.angle == pytest.approx(50.0)
    assert start.rotor_offset == 0.0


def test_noise_of_the_position_does_not_change_the_start() -> None:
    noise = np.random.default_rng(0).normal(0, 1e-5, ROWS)
    start = initial_state(recorded(position_rad=1e-3 + noise), THESIS)
    assert start == Initial(angle=1e-3 / RATIO)


MOVING = interval_means(lambda t: 1e-3 + 0.2 * t + 3.0 * t**2)
"""Position of a user that passes 1 mrad at 0.2 rad/s, 100 rad/s at the motor [rad]."""
SPEED = interval_means(lambda t: (0.2 + 6.0 * t) / RATIO)


@pytest.mark.parametrize(
    ("columns", "speed"),
    [
        ({"position_rad": MOVING}, 100.0),
        ({"speed_rad_s": SPEED}, 100.0),
        ({"speed_rad_s": SPEED, "position_rad": np.full(ROWS, 1e-3)}, 100.0),
        ({"speed_rad_s": np.zeros(ROWS), "position_rad": MOVING}, 0.0),
        ({}, 0.0),
    ],
    ids=["position", "speed", "speed before position", "speed at rest", "neither"],
)
def test_the_initial_speed_is_that_of_the_recorded_speed_or_position(
    columns: dict[str, Array], speed: float
) -> None:
    assert initial_state(recorded(**columns), THESIS).speed == pytest.approx(speed, rel=1e-6, abs=1e-9)


def test_the_initial_angle_of_a_moving_shaft_is_extrapolated_to_time_0() -> None:
    # The first mean is half an interval later, 2e-5 rad farther; the acceleration contributes h².
    start = initial_state(recorded(position_rad=4e-3 + MOVING), THESIS)
    assert start.angle * RATIO == pytest.approx(5e-3, abs=1.1 * INTERVAL**2)
    start = initial_state(recorded(angle_rad=MOVING / RATIO + 0.5, speed_rad_s=SPEED), THESIS)
    assert start.angle == pytest.approx(1e-3 / RATIO + 0.5, abs=1.1 * INTERVAL**2 / RATIO)


@pytest.mark.parametrize("names", [["speed_rad_s"], []], ids=["with speed", "position alone"])
def test_the_initial_angle_of_a_moving_shaft_is_accurate_to_less_than_a_count(names: list[str]) -> None:
    # The rms error of a single row is 1 / √12 of a count, 0.29.
    count, speeds, errors = 2.7e-5, {"speed_rad_s": SPEED}, list[float]()
    for share in np.linspace(0.0, 0.9, 10):
        position = count * np.round((4e-3 + MOVING + share * count) / count)
        start = initial_state(
            recorded(position_rad=position, **{name: speeds[name] for name in names}), THESIS
        )
        errors.append((start.angle * RATIO - 5e-3) / count - share)
    assert np.sqrt(np.mean(np.square(errors))) < 0.2, errors


@pytest.mark.parametrize("noise", [0.0, 1e-6])
def test_a_shaft_at_rest_has_no_speed_though_the_command_moves_at_once(noise: float) -> None:
    actuator = Actuator.dc()
    whole = simulate(actuator, Sine(2e-2, 2.0), model="averaged", duration=0.1)
    shaken = whole["position_rad"] + np.random.default_rng(0).normal(0, noise, whole.samples)
    columns = {name: whole[name] for name in ("time_s", "command_rad", "current_A")}
    columns |= {"position_rad": shaken}
    start = initial_state(Recording(columns, whole.sampling), actuator)
    assert start.speed == 0.0


def test_noise_of_the_speed_is_rarely_an_initial_speed() -> None:
    rng = np.random.default_rng(0)
    initial_speeds = [
        initial_state(recorded(speed_rad_s=rng.normal(0, 0.5, ROWS)), THESIS).speed for _ in range(200)
    ]
    # Three standard errors, estimated with seven degrees of freedom: 2 % by Student's distribution.
    assert np.count_nonzero(initial_speeds) <= 200 * 0.02 + 3 * np.sqrt(200 * 0.02)


@pytest.mark.parametrize("since", [0.0, 7.0, -30.0])
def test_the_initial_state_does_not_depend_on_the_clock(since: float) -> None:
    columns = {"position_rad": MOVING, "angle_rad": MOVING / RATIO + 1.0}
    shifted = initial_state(recorded(time_s=np.asarray(since + TIME), **columns), THESIS)
    unshifted = initial_state(recorded(**columns), THESIS)
    assert shifted.speed == pytest.approx(unshifted.speed, rel=1e-6)
    assert (shifted.angle, shifted.rotor_offset) == (unshifted.angle, unshifted.rotor_offset)


@given(offset=st.floats(-np.pi, np.pi), turns=st.integers(-3, 3))
def test_the_rotor_offset_is_taken_from_the_recorded_angle(offset: float, turns: int) -> None:
    rows = np.full(ROWS, 1e-3)
    angle = rows / RATIO + offset + 2 * np.pi * turns
    rotor_offset = initial_state(recorded(position_rad=rows, angle_rad=angle), THESIS).rotor_offset
    if abs(offset) > LARGEST_GAP + 1e-9:
        assert np.exp(1j * rotor_offset) == pytest.approx(np.exp(1j * offset), abs=1e-9)
    elif abs(offset) < LARGEST_GAP / 2:
        assert rotor_offset == 0.0  # an offset within half the gap is attributed to the gap


def resolver_recording(offset: float, faults: Faults, *, wrapped: bool) -> Recording:
    """Return channels of the reference model, with the zero of the motor angle at the electrical zero."""
    start = Initial(rotor_offset=offset)
    command = Chirp(amplitude=8e-3, duration=0.3)
    inputs = Inputs.of(command, samples=1500, interval=INTERVAL, step=REFERENCE.step)
    signals = run(REFERENCE, Plant.of(THESIS, faults.vector), inputs, start)
    signals["angle_rad"] += offset
    if wrapped:
        signals["angle_rad"] = np.angle(np.exp(1j * signals["angle_rad"]))
    exact = {"time_s": inputs.time_s, "command_rad": inputs.rows(inputs.command)}
    return acquire(Recording(exact | signals), noise={"current_A": 0.05, "angle_rad": 2e-3}, seed=0)


SHORT = Faults(short_b=0.3)


def test_a_short_is_located_for_any_zero_of_the_resolver() -> None:
    unwrapped = resolver_recording(-3.0, SHORT, wrapped=False)
    assert initial_state(unwrapped, THESIS).rotor_offset == pytest.approx(-3.0, abs=0.02)
    recording = resolver_recording(-1.6, SHORT, wrapped=True)
    assert initial_state(recording, THESIS).rotor_offset == pytest.approx(-1.6, abs=0.02)
    diagnosis = diagnose(recording, THESIS, nuisances=USUAL)
    # The published bound for a single fault. Half a sector of error moves a third of it to other phases.
    assert error_percent(SHORT.vector, diagnosis.faults.vector) <= 2.0


CUT = 600
"""Row at which the chirp moves fastest."""


@pytest.mark.parametrize(
    "missing",
    [
        [],
        ["angle_rad"],
        ["position_rad"],
    ],
    ids=["nothing missing", "no angle", "no position"],
)
def test_a_recording_may_start_within_a_motion(missing: list[str]) -> None:
    whole = simulate(THESIS, Chirp(duration=0.3), faults=SHORT, duration=0.3, noise=0.05)
    cut = Recording({name: whole[name][CUT:] for name in whole if name not in missing})
    start = initial_state(cut, THESIS)
    assert start.angle == pytest.approx(whole["position_rad"][CUT] / RATIO, abs=LARGEST_GAP)
    # Over ten rows, the speed of the chirp is a parabola to about one percent.
    assert start.speed == pytest.approx(whole["speed_rad_s"][CUT], rel=0.02)
    assert start.rotor_offset == 0.0
    diagnosis = diagnose(cut, THESIS, nuisances=USUAL)
    assert error_percent(SHORT.vector, diagnosis.faults.vector) <= 2.0


@pytest.mark.parametrize("missing", ["position_rad", ""])
@pytest.mark.parametrize("errors", [{"delay": 2e-3}, {"offset": 0.3, "scale": 2e-3}, {"lag": 5e-4}])
def test_described_errors_of_the_angles_sensor_are_no_motion_and_no_offset(
    errors: dict[str, float], missing: str
) -> None:
    whole = simulate(THESIS, Sine(0.02, 4.0), model="averaged", duration=0.25)
    late = Actuator.from_dict({**THESIS.model_dump(exclude_none=True), "sensors": {"angle_rad": errors}})
    shown = sensed(whole["angle_rad"], late.sensors.angle_rad, INTERVAL)
    columns = {name: whole[name][CUT:] for name in whole if name not in (missing, "angle_rad")}
    start = initial_state(Recording(columns | {"angle_rad": shown[CUT:]}), late)
    assert start.rotor_offset == 0.0
    # Without the described errors, the angle would be wrong by 0.02 to 0.3 rad, the offset by up to 0.3 rad.
    assert start.angle == pytest.approx(whole["angle_rad"][CUT - 1 : CUT + 1].mean(), abs=4e-3)


@pytest.mark.parametrize("delay", [5e-3, 0.05, 0.11])
def test_a_start_behind_a_very_late_sensor_is_not_extrapolated(delay: float) -> None:
    sensors = {name: {"delay": delay} for name in ("position_rad", "speed_rad_s")}
    late = Actuator.from_dict({**THESIS.model_dump(exclude_none=True), "sensors": sensors})
    whole = simulate(THESIS, Sine(0.02, 4.0), model="averaged", duration=0.24, sample_rate=2e4)
    first = 2400
    shown = {name: sensed(whole[name], late.sensors.of(name), whole.interval_s)[first:] for name in sensors}
    columns = {name: whole[name][first:] for name in ("time_s", "command_rad", "current_A")}
    start = initial_state(Recording(columns | shown), late)
    assert start.speed == pytest.approx(whole["speed_rad_s"][first], rel=1e-3)
    assert start.angle == pytest.approx(whole["position_rad"][first] / RATIO, abs=LARGEST_GAP)
    problem_of(Recording(columns | shown), late, channels=None)


def test_a_manoeuvre_about_another_position_is_diagnosed() -> None:
    chirp = Chirp(duration=0.3)
    inputs = Inputs.of(lambda t: 0.1 + chirp(t), samples=1500, interval=INTERVAL, step=REFERENCE.step)
    start = Initial(angle=0.1 / RATIO)
    signals = run(REFERENCE, Plant.of(THESIS, SHORT.vector), inputs, start)
    exact = {"time_s": inputs.time_s, "command_rad": inputs.rows(inputs.command)}
    diagnosis = diagnose(Recording(exact | signals), THESIS, nuisances=USUAL)
    assert error_percent(SHORT.vector, diagnosis.faults.vector) <= 2.0


# Load and predictions.


@pytest.mark.usefixtures("one_search")
def test_a_recorded_load_is_a_known_input() -> None:
    gust = Sampled([0.0, 0.06, 0.12, 0.3], [0.0, 0.15, -0.1, 0.1])
    faults = Faults(friction=0.25)
    whole = simulate(THESIS, Chirp(duration=0.3), duration=0.3, faults=faults, load=gust, noise=0.05)
    known = diagnose(whole, THESIS, nuisances=USUAL)
    without = Recording({name: whole[name] for name in whole if name != "load_Nm"})
    # The nuisances are named, so that no law is tried that could explain the gust.
    unknown = diagnose(without, THESIS, nuisances=USUAL)
    assert error_percent(faults.vector, known.faults.vector) <= 2.0
    assert known.explained
    assert error_percent(faults.vector, unknown.faults.vector) > 5.0
    assert unknown.residual_rms_A > 3 * known.residual_rms_A


def test_a_batch_predicts_the_currents_of_single_runs(shorted: Recording) -> None:
    problem = problem_of(shorted, THESIS)
    faults = np.stack([HEALTHY, SHORT.vector])
    batch = problem.predict_primary(faults)
    assert batch.shape == (2, shorted.samples)
    for row, k in zip(batch, faults, strict=True):
        # Vector and scalar instructions may round differently; the averaged model is not chaotic.
        np.testing.assert_allclose(row, problem.signals(k)["current_A"], rtol=0, atol=1e-8)


def test_signals_have_the_angle_of_the_sensor() -> None:
    recording = resolver_recording(1.0, SHORT, wrapped=False)
    angle = problem_of(recording, THESIS).signals(SHORT.vector)["angle_rad"]
    # The models agree on the motion to a hundredth of a turn of the rotor.
    np.testing.assert_allclose(angle, recording["angle_rad"], rtol=0, atol=0.06)


def test_the_step_of_a_model_divides_the_interval() -> None:
    for model in (AVERAGED, REFERENCE):
        inputs = problem_of(recorded(), THESIS, model).inputs
        assert inputs.interval == pytest.approx(INTERVAL)
        assert inputs.step <= model.step * (1 + 1e-9)
        assert inputs.samples == ROWS


def test_inputs_at_the_steps_of_a_model_are_cached(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = problem_of(recorded(), THESIS)
    assert problem.by(REFERENCE).inputs is problem.by(REFERENCE).inputs
    monkeypatch.setattr(driving_signals, "MOST_KEPT_STEPS", 0)
    unkept = problem_of(recorded(), THESIS)
    first, second = (unkept.by(REFERENCE).inputs for _ in range(2))
    assert first is not second
    np.testing.assert_array_equal(first.command, second.command)


def test_the_cache_of_inputs_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """The oldest inputs are removed first; inputs of deleted recordings do not count."""
    monkeypatch.setattr(driving_signals, "_CACHE", WeakKeyDictionary())
    problems = [problem_of(recorded(), THESIS) for _ in range(3)]
    first = problems[0].by(REFERENCE).inputs
    monkeypatch.setattr(driving_signals, "MOST_KEPT_STEPS", 2 * first.command.size)
    for problem in problems[1:]:
        problem.by(REFERENCE)
    assert problems[2].by(REFERENCE).inputs is problems[2].by(REFERENCE).inputs
    assert problems[0].by(REFERENCE).inputs is not first
    del problems, problem
    alone = problem_of(recorded(), THESIS)
    assert alone.by(REFERENCE).inputs is alone.by(REFERENCE).inputs


def test_phase_currents_and_angle_may_replace_the_equivalent_current(shorted: Recording) -> None:
    names = ("time_s", "command_rad", "current_a_A", "current_b_A", "current_c_A", "angle_rad")
    phases = Recording({name: shorted[name] for name in names})
    assert diagnose(phases, THESIS, nuisances=USUAL).faults.short_b == pytest.approx(0.3, abs=0.02)
