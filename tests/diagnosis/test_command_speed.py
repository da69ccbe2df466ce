"""A command in a wrong unit requires speeds beyond any motor; a step requires them only at its jumps."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Chirp, Command, Ramp, Step
from emaphm.arrays import Array
from emaphm.diagnosis.explanation.command_speed import notes_on_command, with_command
from emaphm.estimation.posing import problem_of
from emaphm.estimation.problem import Problem
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate


def staircase(t: Array) -> Array:
    """Return steps of 8 mrad, forth and back, whose times are within a row [rad]."""
    return np.where(np.floor(t / 0.05003) % 2 == 1, 8e-3, 0.0)


@pytest.mark.parametrize("command", [Chirp(), Step(start=0.1), staircase, Ramp()])
def test_a_possible_command_has_no_note(command: Command) -> None:
    assert notes_on_command(problem(command, 1.0)) == ()


@pytest.mark.parametrize("factor", [180 / np.pi, 1e3])
def test_a_command_in_a_smaller_unit_has_a_note(factor: float) -> None:
    (note,) = notes_on_command(problem(Chirp(), factor))
    assert "check the unit of command_rad" in note


def problem(command: Command, factor: float) -> Problem:
    whole = simulate(THESIS, command, model="averaged", duration=0.3)
    columns = {name: whole[name] for name in ("time_s", "command_rad", "current_A")}
    columns["command_rad"] = factor * columns["command_rad"]
    return problem_of(Recording(columns), THESIS, channels=None)


def test_a_note_on_the_command_replaces_hints_on_the_units_of_other_channels() -> None:
    residual = "current_A: the residual of 298 % is more than noise accounts for"
    hints = (residual, "voltage_V: the residual of 128 % is too large; its unit may be wrong")
    wrong_unit = problem(Chirp(), 180 / np.pi)
    assert with_command(hints, wrong_unit) == (*notes_on_command(wrong_unit), residual)
    assert with_command(hints, problem(Chirp(), 1.0)) == hints
