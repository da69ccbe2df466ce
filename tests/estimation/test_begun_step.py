"""Recordings that begin shortly after a step of the command, while the shaft still moves."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cases import INTERVAL, THESIS
from emaphm.actuator import Faults
from emaphm.diagnosis import diagnose, error_percent
from emaphm.estimation.posing import problem_of
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.simulation import Initial

STEP = 250
FAULTS = Faults(friction=0.3, short_a=0.15)
COUNT = 2 * 0.5236 / 4096
"""Resolution of an encoder of 12 bits over 60 degrees [rad]."""


@cache
def full_recording() -> Recording:
    """Return a step after 50 ms, and a chirp from 200 ms on."""

    def command(time: np.ndarray) -> np.ndarray:
        chirp = 3e-3 * np.sin(2 * np.pi * 16 * np.maximum(time - 0.2, 0.0) ** 2)
        return chirp + np.where(time < STEP * INTERVAL - 1e-9, 0.0, 4e-3)

    return simulate(THESIS, command, faults=FAULTS, noise=0.05)


def cut(first: int, count: float = COUNT, *names: str) -> Recording:
    columns = {
        name: full_recording()[name][first:]
        for name in ("time_s", "command_rad", "current_A", "voltage_V", "position_rad", *names)
    }
    return Recording(columns | {"position_rad": np.round(columns["position_rad"] / count) * count})


@pytest.mark.parametrize("later", [1, 3])
def test_compared_rows_do_not_depend_on_the_instant_of_the_step(later: int) -> None:
    problem = problem_of(cut(STEP + later), THESIS, channels=None)
    rows = problem.unknown_start.rows
    position, speed = (full_recording()[name][STEP + later] for name in ("position_rad", "speed_rad_s"))
    moving = replace(problem, start=Initial(position / THESIS.mechanics.gear_ratio, speed, gap=1.0))
    as_started, true = (candidate.predict(FAULTS.vector[np.newaxis])[0, 0] for candidate in (problem, moving))
    difference = np.abs(as_started - true)
    assert difference[:rows].max() > 1.0
    assert difference[rows:].max() < 0.1
    assert "on its way" in problem.unknown_start.notes()[0]


def test_a_recording_that_begins_by_the_row_of_the_step_is_compared_in_full() -> None:
    for first in (STEP - 100, STEP - 1, STEP):
        assert problem_of(cut(first), THESIS, channels=None).unknown_start.rows == 0


def test_a_recorded_speed_determines_the_initial_state() -> None:
    problem = problem_of(cut(STEP + 20, COUNT, "speed_rad_s"), THESIS, channels=None)
    assert problem.unknown_start.rows == 0
    assert problem.start.gap == 1.0


def test_a_recording_that_begins_after_the_step_is_explained() -> None:
    diagnosis = diagnose(cut(STEP + 1), THESIS)
    assert diagnosis.explained
    assert error_percent(FAULTS.vector, diagnosis.faults.vector) <= 2.0
