"""Recordings that begin after or within a motion: the side of the backlash at which models start."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cases import INTERVAL, THESIS
from emaphm.actuator import Faults, Sampled
from emaphm.diagnosis import diagnose
from emaphm.estimation.posing import problem_of
from emaphm.estimation.rows.moving_start import command_moves
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.simulation import Initial

RATIO = THESIS.mechanics.gear_ratio
REST = 1250
"""Row in which a rest of 0.1 s ends; the chirp after it reaches 10 Hz within 0.3 s."""
ELECTRICAL = ("current_A", "voltage_V")
MOTION = ("position_rad", "speed_rad_s")


@cache
def full_recording(way: int = 1, faults: Faults = Faults(), load: float = 0.0) -> Recording:  # noqa: B008 - frozen
    """Return a move over 0.15 s `way` up or down, a rest up to 0.25 s, and a chirp up to 0.55 s."""
    time = np.arange(2750) * INTERVAL
    share = np.clip(time / 0.15, 0.0, 1.0)
    since = np.maximum(time - REST * INTERVAL, 0.0)
    command = 6e-3 * way * share**3 * (10 - 15 * share + 6 * share**2)
    command += 5e-3 * np.sin(2 * np.pi * 16 * since**2)
    return simulate(THESIS, Sampled(time, command), faults=faults, load=load, duration=0.55, noise=0.02)


def cut(first: int, *names: str, way: int = 1, faults: Faults = Faults(), load: float = 0.0) -> Recording:  # noqa: B008
    recording = full_recording(way, faults, load)
    names = ("time_s", "command_rad", *names, *(("load_Nm",) if load else ()))
    return Recording({name: recording[name][first:] for name in names})


def sides(recording: Recording, faults: Faults) -> np.ndarray:
    """Return the lead of the motor over the user in half widths of the gap, (samples,)."""
    width = THESIS.mechanics.backlash * (1 + THESIS.faults.backlash * faults.backlash)
    return (recording["angle_rad"] - recording["position_rad"] / RATIO) / (width / 2)


@pytest.mark.parametrize("faults", [Faults(), Faults(backlash=0.4, friction=0.3)], ids=["healthy", "faults"])
@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("names", [ELECTRICAL, (*ELECTRICAL, *MOTION)], ids=len)
@pytest.mark.parametrize("first", [REST - 100, REST - 10, 300, 2000])
def test_the_motor_starts_at_the_side_to_which_the_last_motion_led(
    first: int, names: tuple[str, ...], way: int, faults: Faults
) -> None:
    problem = problem_of(cut(first, *names, way=way, faults=faults), THESIS, channels=None)
    assert problem.start.gap == pytest.approx(sides(full_recording(way, faults), faults)[first], abs=0.01)


@pytest.mark.parametrize("names", [("current_A",), (*ELECTRICAL, "position_rad")], ids=len)
def test_rows_that_depend_on_an_unknown_side_are_not_compared(names: tuple[str, ...]) -> None:
    faults = Faults(backlash=0.4)
    for first in (REST - 20, REST):
        problem = problem_of(cut(first, *names, faults=faults), THESIS, channels=None)
        other = replace(problem, start=replace(problem.start, gap=-problem.start.gap))
        known, unknown = (
            candidate.predict(faults.vector[np.newaxis])[0, 0] for candidate in (problem, other)
        )
        rows, difference = problem.unknown_start.rows, np.abs(known - unknown)
        assert difference.max() > 0.2
        assert difference[rows:].max() < 0.05


def test_after_a_reversal_the_side_is_unknown() -> None:
    recording = full_recording()
    # The first row in which the motor crosses the gap, half a cycle into the chirp.
    turn = REST + 300 + int(np.argmax(np.abs(sides(recording, Faults())[REST + 300 :]) < 0.9))
    problem = problem_of(cut(turn, *ELECTRICAL, *MOTION), THESIS, channels=None)
    assert 0 < problem.unknown_start.seconds < 0.05
    assert any("side of the backlash" in note for note in problem.unknown_start.notes())
    fast = problem_of(cut(turn + 60, *ELECTRICAL, *MOTION), THESIS, channels=None)
    assert (fast.unknown_start.rows, fast.start.gap) == (0, np.sign(recording["speed_rad_s"][turn + 60]))


def test_before_any_motion_the_motor_starts_in_the_middle_of_the_gap() -> None:
    for names in (("current_A",), (*ELECTRICAL, *MOTION)):
        problem = problem_of(cut(0, *names, load=0.05), THESIS, channels=None)
        assert (problem.start.gap, problem.unknown_start.rows) == (0.0, 0)


def test_the_start_in_the_gap_is_relative_to_its_width() -> None:
    faults = np.array([Faults().vector, Faults(backlash=0.5).vector])
    problem = problem_of(cut(0, *ELECTRICAL, *MOTION), THESIS, channels=None)
    moves = []
    for gap in (1.0, 0.0, -1.0):
        started = replace(problem, start=Initial(gap=gap))
        positions = started.exact(faults, {}, ("position_rad",))[:, 0]
        moves.append(np.argmax(positions > 1e-9, axis=1))
    # From the edge, the motor crosses no gap; a gap 5.5 times as wide takes longer.
    assert np.all(np.diff(moves, axis=0) > 0)
    assert np.diff(moves[2]) > np.diff(moves[1]) > np.diff(moves[0]) == 0


def test_backlash_of_a_healthy_actuator_is_not_degraded_after_a_motion() -> None:
    diagnosis = diagnose(cut(REST, "current_A", way=-1), THESIS)
    assert diagnosis.explained
    assert diagnosis.components["backlash"].verdict != "degraded"
    assert diagnosis.interval["backlash"][0] < 1e-3


def test_command_moves_is_false_for_a_command_that_begins_at_rest() -> None:
    time = np.arange(2000) * INTERVAL
    for begin, moves in ((0.005, False), (0.0, True)):
        command = 0.05 * np.maximum(time - begin, 0.0)
        recording = Recording({"time_s": time, "command_rad": command, "current_A": np.sin(time)})
        assert command_moves(problem_of(recording, THESIS)) is moves
