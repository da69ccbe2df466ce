"""Rows that are not compared because the drive may have sampled its command a period earlier or later."""

import numpy as np
import pytest

from emaphm.actuator import Actuator, Chirp, Command
from emaphm.actuator.channels import Sampling
from emaphm.arrays import Array
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.after_jumps import MOST_SHARE, rows_after_jumps
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

PMSM = Actuator.pmsm()


def square(t: Array) -> Array:
    return 5e-3 * np.sign(np.sin(2 * np.pi * 6.0 * t - 0.2))


def problem(actuator: Actuator, command: Command, sampling: Sampling = "mean") -> Problem:
    begin = float(command(np.zeros(1))[0])
    whole = simulate(actuator, command, duration=0.25, noise=0.05, initial_position=begin)
    columns = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")}
    return problem_of(Recording(columns, sampling), actuator, channels=None)


def test_rows_after_jumps_of_a_drive_with_pwm_are_not_compared() -> None:
    command = problem(PMSM, square).measured["command_rad"]
    jumps = np.flatnonzero(np.diff(command))
    masks = rows_after_jumps(problem(PMSM, square))
    assert set(masks) == {"current_A", "voltage_V"}
    for mask in masks.values():
        assert 0 < mask.mean() < MOST_SHARE
        # Within 30 ms, the time in which the motor reaches the commanded position.
        after = [row - jumps[jumps <= row].max(initial=-1000) for row in np.flatnonzero(mask)]
        assert max(after) < 150


@pytest.mark.parametrize(
    ("actuator", "command", "sampling"),
    [(PMSM, Chirp(duration=0.25), "mean"), (PMSM, square, "instant"), (Actuator.thesis(), square, "mean")],
    ids=["smooth", "instants", "comparators"],
)
def test_all_rows_are_compared_without_jumps_or_without_pwm_or_means(
    actuator: Actuator, command: Command, sampling: Sampling
) -> None:
    assert rows_after_jumps(problem(actuator, command, sampling)) == {}


def test_masks_of_rows_are_combined() -> None:
    objective = faults_objective(problem(PMSM, square), None)
    early, late = (np.arange(objective.problem.samples) < 10), (np.arange(objective.problem.samples) > 1200)
    combined = objective.ignoring({"current_A": early}).ignoring({"current_A": late, "voltage_V": late})
    np.testing.assert_array_equal(combined.problem.unusable["current_A"], early | late)
    np.testing.assert_array_equal(combined.problem.unusable["voltage_V"], late)
