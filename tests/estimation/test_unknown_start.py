"""Rows that are not compared because the recording begins within a motion from an unknown state."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cases import INTERVAL, THESIS, USUAL
from emaphm.actuator import Actuator, Chirp, Command, Faults, Ramp, Sine, Step
from emaphm.diagnosis import diagnose, error_percent
from emaphm.estimation import replay
from emaphm.estimation.posing import problem_of
from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.moving_start import MOVING_START
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.simulation import Initial
from emaphm.simulation.laws.sensors import sensed

ELECTRICAL = ("current_A", "voltage_V")
RATIO = THESIS.mechanics.gear_ratio
FAULTS = Faults(friction=0.4, short_b=0.2)


@cache
def full_recording() -> Recording:
    return simulate(THESIS, Chirp(duration=0.4), faults=FAULTS, duration=0.4, noise=0.05)


def cut(first: int, *names: str, last: int | None = None) -> Recording:
    """Return the rows of a chirp from the `first` to the `last`, with the channels `names`."""
    return Recording({name: full_recording()[name][first:last] for name in ("time_s", "command_rad", *names)})


@pytest.mark.parametrize("first", [300, 550, 700, 900])
@pytest.mark.parametrize("names", [ELECTRICAL, ("current_A",), ("current_A", "speed_rad_s")], ids=str)
def test_compared_rows_do_not_depend_on_the_unknown_start(first: int, names: tuple[str, ...]) -> None:
    problem = problem_of(cut(first, *names), THESIS, channels=None)
    rows = problem.unknown_start.rows
    assert 50 <= rows <= 450
    known = Initial(full_recording()["position_rad"][first] / RATIO, full_recording()["speed_rad_s"][first])
    from_rest, moving = (
        candidate.predict(FAULTS.vector[np.newaxis])[0]
        for candidate in (problem, replace(problem, start=known))
    )
    difference = np.abs(from_rest - moving)[0]
    # The noise is 0.05 A.
    assert difference[:rows].max() > 1.0
    assert difference[rows:].max() < 0.05
    for name in problem.channels:
        np.testing.assert_array_equal(np.flatnonzero(problem.unusable[name]), np.arange(rows))


def in_counts(recording: Recording, count: float) -> Recording:
    """Return a recording whose position comes from a coarse converter."""
    position = np.round(recording["position_rad"] / count) * count
    return Recording({name: recording[name] for name in recording} | {"position_rad": position})


@pytest.mark.parametrize("first", [300, 619, 900])
def test_a_fine_position_or_a_speed_identifies_the_start_and_a_coarse_one_does_not(first: int) -> None:
    fine = cut(first, *ELECTRICAL, "position_rad")
    with_speed = cut(first, *ELECTRICAL, "position_rad", "speed_rad_s")
    count = 2.6e-4  # 12 bits over 60 degrees: an eighth of a radian at the motor
    unknown = [
        problem_of(recording, THESIS, channels=None).unknown_start.seconds
        for recording in (fine, with_speed, in_counts(with_speed, count), in_counts(fine, count))
    ]
    # At the turn, row 619, the motor crosses the backlash while the user stands.
    assert max(unknown[:3]) <= (0.02 if first == 619 else 0.0)
    assert unknown[3] > 0.01


def test_a_start_in_motion_is_found_behind_late_sensors() -> None:
    sensors = {"position_rad": {"delay": 2e-3, "lag": 2e-4}, "speed_rad_s": {"delay": 1e-3}}
    late = Actuator.from_dict({**THESIS.model_dump(exclude_none=True), "sensors": sensors})
    full, first = full_recording(), 700
    shown = {name: sensed(full[name], late.sensors.of(name), full.interval_s)[first:] for name in sensors}
    recording = Recording({**cut(first, *ELECTRICAL).channels, **shown})
    problem = problem_of(recording, late, channels=None)
    # Between rows: a row is a mean, valid half an interval after its beginning.
    angle, speed = (full[name][first - 1 : first + 1].mean() for name in sensors)
    travelled = abs(full["position_rad"][first] - full["position_rad"][first - 10])
    assert abs(problem.start.angle * RATIO - angle) < 0.02 * travelled
    assert problem.start.speed == pytest.approx(speed, rel=0.01)
    assert problem.unknown_start.seconds == pytest.approx(2e-3 + 5 * 2e-4)


def test_a_slow_servo_without_a_position_is_compared_after_it_has_forgotten_its_start() -> None:
    description = THESIS.model_dump(exclude_none=True) | {
        "name": "servo",
        "drive": {"kind": "voltage"},
        "controller": {"position_gain": 1.15, "speed_gain": 1.0, "speed_feedback": 0.0, "current_limit": 3.0},
        "motor": {"torque_constant": 0.4},
        "electrical": {"supply": 7.4, "resistance": 3.5, "inductance": 1e-4},
        "mechanics": {
            "inertia_motor": 6e-3,
            "viscous_motor": 5e-3,
            "static_friction_motor": 0.02,
            "dynamic_friction_motor": 0.02,
            "gear_ratio": 1.0,
        },
    }
    servo, first = Actuator.from_dict(description), 333
    swing = simulate(
        servo, Sine(0.8, 0.9), model="averaged", duration=5.0, sample_rate=200, sampling="instant"
    )
    names = ("time_s", "command_rad", "current_A")
    part = Recording({name: swing[name][first:] for name in names}, "instant")
    problem = problem_of(part, servo, channels=None)
    known = Initial(swing["position_rad"][first], swing["speed_rad_s"][first])
    from_rest, moving = (
        candidate.predict(Faults().vector[np.newaxis])[0, 0]
        for candidate in (problem, replace(problem, start=known))
    )
    rows, difference = problem.unknown_start.rows, np.abs(from_rest - moving)
    assert rows * problem.inputs.interval > MOVING_START.longest
    assert difference[rows:].max() < 0.01 * np.ptp(swing["current_A"])


def test_the_assumed_motion_before_the_start_is_within_the_end_stops() -> None:
    # 10 Hz in rows of 10 ms: the parabola through the first three rows extends far beyond 30 degrees.
    k = np.arange(60)
    columns = {"time_s": k / 100, "command_rad": 0.5 * np.sin(0.63 * k), "current_A": np.sin(k)}
    for position in (0.45 * np.sin(0.63 * k - 0.3), 0.5 * np.cos(k)):
        problem = problem_of(Recording(columns | {"position_rad": position}), THESIS, channels=None)
        assert 0 <= problem.unknown_start.seconds <= 0.3


@pytest.mark.parametrize("command", [Chirp(), Sine(), Sine(5e-3, 9.0), Ramp(0.2), Step(5e-3, 0.1)])
@pytest.mark.parametrize("faults", [Faults(), FAULTS], ids=["healthy", "faults"])
def test_from_rest_every_row_is_compared(command: Command, faults: Faults) -> None:
    full = simulate(THESIS, command, faults=faults, model="averaged", noise=0.05)
    recording = Recording({name: full[name] for name in ("time_s", "command_rad", *ELECTRICAL)})
    problem = problem_of(recording, THESIS, channels=None)
    assert (problem.unknown_start.seconds, dict(problem.unusable)) == (0.0, {})


@pytest.mark.parametrize("motion", [("position_rad",), ("speed_rad_s", "angle_rad")], ids=str)
def test_with_a_recorded_motion_every_row_is_compared(motion: tuple[str, ...]) -> None:
    problem = problem_of(cut(700, *ELECTRICAL, *motion), THESIS, channels=None)
    assert (problem.unknown_start.seconds, dict(problem.unusable)) == (0.0, {})


def test_at_least_half_of_a_short_recording_is_compared() -> None:
    problem = problem_of(cut(700, *ELECTRICAL, last=800), THESIS, channels=None)
    assert problem.unknown_start.seconds == pytest.approx(MOVING_START.most * 100 * INTERVAL)


@cache
def triangle() -> Recording:
    """Return a triangle that begins after 20 ms and turns at 60, 140 and 200 ms, a third into a row."""
    corners = np.array([0.0, 0.02, 0.06, 0.14, 0.2, 0.28, 0.36, 0.4]) + INTERVAL / 3
    angles = 4e-3 * np.array([0, 0, 1, -1, 0.5, -1, 1, 0])

    def command(time: np.ndarray) -> np.ndarray:
        return np.asarray(np.interp(time, corners, angles))

    return simulate(THESIS, command, faults=FAULTS, duration=0.4, noise=0.05, load=0.02)


def of_triangle(first: int, *names: str) -> Problem:
    columns = {name: triangle()[name][first:] for name in ("time_s", "command_rad", *names)}
    return problem_of(Recording(columns), THESIS, channels=None)


@pytest.mark.parametrize("first", range(697, 704))
@pytest.mark.parametrize("names", [("current_A",), ("current_A", "load_Nm")], ids=str)
def test_a_start_near_a_reversal_is_no_start_from_rest(first: int, names: tuple[str, ...]) -> None:
    unknown_start = of_triangle(first, *names).unknown_start
    assert 50 <= unknown_start.rows <= 400
    assert not any("at a rest" in note for note in unknown_start.notes())


@pytest.mark.parametrize("first", [0, 96, 98, 99, 100])
@pytest.mark.parametrize(
    "names", [("current_A", "load_Nm"), ("current_A", "load_Nm", "speed_rad_s")], ids=str
)
def test_every_row_is_compared_from_a_start_at_rest_before_a_corner(
    first: int, names: tuple[str, ...]
) -> None:
    assert of_triangle(first, *names).unknown_start.rows == 0


def test_a_diagnosis_without_these_rows_is_accurate_and_has_a_note() -> None:
    diagnosis = diagnose(cut(700, *ELECTRICAL), THESIS, nuisances=USUAL)
    assert diagnosis.explained
    assert error_percent(FAULTS.vector, diagnosis.faults.vector) <= 2.0
    (note,) = (line for line in diagnosis.recording_notes if "first row" in line)
    assert "position_rad" in note


def test_a_replay_without_these_rows_has_a_note() -> None:
    result = replay(cut(700, *ELECTRICAL), THESIS, faults=FAULTS)
    assert result.first_row * INTERVAL == pytest.approx(
        problem_of(cut(700, *ELECTRICAL), THESIS).unknown_start.seconds
    )
    assert "not compared" in result.recording.notes[-1]
    # As for a whole recording (test_replay): 0.08 A between the models and 0.05 A of noise, of 2.4 A.
    assert result.relative_error["current_A"] < 0.06
