"""Recordings that begin at a rest after a motion, where friction holds the shaft away from the command."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cases import INTERVAL, THESIS
from emaphm.actuator import Actuator, Faults, Sampled, Step
from emaphm.diagnosis import diagnose, error_percent
from emaphm.estimation import replay
from emaphm.estimation.posing import problem_of
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.simulation import Initial

ELECTRICAL = ("current_A", "voltage_V")
FAULTS = Faults(friction=0.4, short_b=0.2)
FIRST = 2500
"""Row in the middle of the first rest, which ends at row 3000."""
REST = 3000


@cache
def full_recording(faults: Faults = FAULTS, last_phase: float = 0.3) -> Recording:
    """Return a sine over 0.4 s, a rest up to 0.6 s, and a chirp from there on: 1.1 s."""
    time = np.arange(5500) * INTERVAL
    end = 3e-3 * np.sin(2 * np.pi * (2 + last_phase))
    command = np.where(time < 0.4, 3e-3 * np.sin(2 * np.pi * (2 + last_phase) * time / 0.4), end)
    since = np.maximum(time - 0.6, 0.0)
    command += 5e-3 * np.sin(2 * np.pi * 15 * since**2)
    return simulate(THESIS, Sampled(time, command), faults=faults, duration=1.1, noise=0.05)


def cut(first: int, *names: str, faults: Faults = FAULTS) -> Recording:
    """Return the rows from the `first` on, with the channels `names`."""
    recording = full_recording(faults)
    return Recording({name: recording[name][first:] for name in ("time_s", "command_rad", *names)})


@pytest.mark.parametrize("names", [ELECTRICAL, (*ELECTRICAL, "position_rad", "speed_rad_s")], ids=len)
@pytest.mark.parametrize("first", [2050, FIRST, 2940, 2990, REST])
def test_the_rest_and_the_rows_that_depend_on_it_are_not_compared(first: int, names: tuple[str, ...]) -> None:
    as_recorded = problem_of(cut(first, *names), THESIS, channels=None)
    # A position identifies the angle of the shaft, but the current at this angle still depends on faults.
    problem = replace(
        as_recorded, start=Initial(full_recording()["command_rad"][first] / THESIS.mechanics.gear_ratio)
    )
    rows = problem.unknown_start.rows
    assert problem.unknown_start.held
    assert REST - first <= rows <= REST - first + 500
    for name in problem.channels:
        np.testing.assert_array_equal(np.flatnonzero(problem.unusable[name]), np.arange(rows))
    # The true position of the shaft: the compared rows do not depend on the start.
    true_start = Initial(full_recording()["position_rad"][first] / THESIS.mechanics.gear_ratio)
    on_command, held = (
        candidate.predict(FAULTS.vector[np.newaxis])[0, 0]
        for candidate in (problem, replace(problem, start=true_start))
    )
    difference = np.abs(on_command - held)
    assert difference[: max(REST - first, 10)].max() > 0.2
    assert difference[rows:].max() < 0.05


@pytest.mark.parametrize("names", [ELECTRICAL, ("current_A",), (*ELECTRICAL, "position_rad")], ids=str)
@pytest.mark.parametrize("rest_s", [0.1, 0.0])
def test_before_any_motion_every_row_is_compared(names: tuple[str, ...], rest_s: float) -> None:
    time = np.arange(2500) * INTERVAL
    command = 5e-3 * np.sin(2 * np.pi * 15 * np.maximum(time - rest_s, 0.0) ** 2)
    for faults in (Faults(), FAULTS):
        full = simulate(THESIS, Sampled(time, command), faults=faults, noise=0.05, load=0.05)
        recording = Recording({name: full[name] for name in ("time_s", "command_rad", "load_Nm", *names)})
        problem = problem_of(recording, THESIS, channels=None)
        assert (problem.unknown_start.rows, dict(problem.unusable)) == (0, {})


def test_a_diagnosis_without_the_rest_is_accurate_and_has_a_note() -> None:
    diagnosis = diagnose(cut(FIRST, *ELECTRICAL), THESIS)
    assert diagnosis.explained
    assert error_percent(FAULTS.vector, diagnosis.faults.vector) <= 1.0
    assert diagnosis.sensor_faults == ()
    (note,) = (line for line in diagnosis.recording_notes if "begins at a rest" in line)
    assert "0.1" in note


def test_a_rest_is_detected_where_the_command_begins_slowly_in_the_first_row() -> None:
    diagnosis = diagnose(cut(REST, "current_A"), THESIS)
    assert diagnosis.explained
    assert error_percent(FAULTS.vector, diagnosis.faults.vector) <= 1.5
    assert (diagnosis.sensor_faults, abs(diagnosis.nuisances["load"].value) < 0.001) == ((), True)
    assert any("friction that holds the shaft" in note for note in diagnosis.recording_notes)


# Omitted rows are tested above, the estimated offset in `tests/diagnosis/test_nuisance_selection.py`.
@pytest.mark.evidence
def test_the_zero_error_of_a_sensor_is_estimated_from_the_motion() -> None:
    recording, zero = cut(FIRST, *ELECTRICAL), -0.3
    columns = {name: recording[name] + zero * (name == "current_A") for name in recording}
    shifted = Recording({name: rows[:2000] for name, rows in columns.items()})
    (fault,) = diagnose(shifted, THESIS).sensor_faults
    assert (fault.channel, fault.kind) == ("current_A", "bias")
    assert fault.size == pytest.approx(zero, abs=0.01)


def test_a_shaft_still_away_from_a_stepped_command_is_not_held() -> None:
    time = np.arange(3000) * INTERVAL
    command = 5e-3 + 5e-3 * np.sin(2 * np.pi * 15 * np.maximum(time - 0.1, 0.0) ** 2)
    full = simulate(THESIS, Sampled(time, command), duration=0.6, noise=0.05)
    recording = Recording(
        {name: full[name] for name in ("time_s", "command_rad", "position_rad", *ELECTRICAL)}
    )
    problem = problem_of(recording, THESIS, channels=None)
    assert problem.start.angle == pytest.approx(0.0, abs=0.1)
    assert not problem.unknown_start.held


def test_where_only_a_step_follows_every_row_is_compared_and_a_note_warns() -> None:
    # An unrecorded load larger than friction: the current during the rest identifies it.
    step = Step(5e-3, 0.05)
    full = simulate(THESIS, step, load=0.25, faults=Faults(short_b=0.2), noise=0.05, duration=0.15)
    recording = Recording({name: full[name] for name in ("time_s", "command_rad", *ELECTRICAL)})
    diagnosis = diagnose(recording, THESIS)
    assert (len(diagnosis.recorded), diagnosis.explained) == (full.samples, True)
    assert abs(diagnosis.nuisances["load"].value - 0.25) < 0.01
    assert diagnosis.components["short_b"].verdict == "degraded"
    assert any("use the estimates of load" in note for note in diagnosis.recording_notes)
    recorded = Recording({name: full[name] for name in ("time_s", "command_rad", "load_Nm", *ELECTRICAL)})
    assert not problem_of(recorded, THESIS, channels=None).unknown_start.held


def test_a_coarse_position_does_not_change_the_start() -> None:
    recording = cut(FIRST, *ELECTRICAL, "position_rad")
    count = 6e-4  # 12 bits over 144 degrees
    coarse = np.round(recording["position_rad"] / count) * count
    problem = problem_of(
        Recording({name: recording[name] for name in recording} | {"position_rad": coarse}), THESIS
    )
    assert problem.start.angle * THESIS.mechanics.gear_ratio == pytest.approx(recording["command_rad"][0])


def test_a_replay_without_the_rest_has_a_note() -> None:
    result = replay(cut(FIRST, *ELECTRICAL), THESIS, faults=FAULTS)
    assert result.first_row > REST - FIRST
    assert "begins at a rest" in result.recording.notes[-1]


@pytest.mark.parametrize("name", ["pmsm", "six-step"])
def test_a_held_start_is_within_the_travel_where_the_current_does_not_depend_on_it(name: str) -> None:
    actuator = Actuator.load(name)
    command = Sampled(np.linspace(0.0, 0.4, 9), 0.157 * np.array([0, 0, 0, 1, 1, 1, 0.5, 0.5, 0.5]))
    whole = simulate(
        actuator,
        command,
        faults=Faults(friction=0.3),
        model="averaged",
        duration=0.6,
        sample_rate=100.0,
        sampling="instant",
    )
    channels = ("time_s", "command_rad", "current_A", "voltage_V", "position_rad")
    recording = Recording({channel: whole[channel][:58] for channel in channels}, "instant")
    # In rows of 10 ms, a distance of a millionth of the travel changes the current by rounding alone.
    assert problem_of(recording, actuator, channels=None).samples == 58
