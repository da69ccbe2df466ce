"""Rows at the start of a recording that begins while the shaft still moves to a constant command.

A coarse position shows that the command has not been reached, but no speed: the model starts there at rest.
If the step of the command was before the first row, the current has already risen and the shaft has begun to
move; the model's response is then shifted in time until it has settled.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.first_rows import first_rows, likely_faults, rows_apart
from emaphm.estimation.rows.gap_side import leaves_enough, motion_after
from emaphm.estimation.rows.held_start import CURRENT
from emaphm.recording.noise import noise_on_most_rows


@dataclass(frozen=True)
class BegunStepSettings:
    """Settings of the detection of a step before the recording.

    A step is detected if one of the first `rows` rows of the current exceeds those of models with likely
    faults by `significant` times its noise, and by the share `resolved` of the largest current: the current
    of a switching drive oscillates about its limit. Rows are left out until three models no longer differ:
    one that starts with the speed from the position, one that starts at rest, and one that starts at rest
    `sooner` [s] earlier.
    """

    rows: int = 5
    significant: float = 3.0
    resolved: float = 0.05
    sooner: float = 1e-3


BEGUN_STEP = BegunStepSettings()


def rows_of_begun_step(problem: Problem) -> int:
    """Return the number of first rows that depend on the time of a step before the recording.

    It is 0 if the shaft begins at rest, if its speed was recorded, or if too little motion would remain.
    """
    speed_known = "speed_rad_s" in problem.measured and problem.start.speed
    if CURRENT not in problem.channels or speed_known or _is_on_command(problem):
        return 0
    faults, interval, angle = likely_faults(problem), problem.inputs.interval, problem.start.angle
    driving = motion_after(problem)
    outputs = [first_rows(problem, driving, angle, faults)]
    if _is_current_of_models(problem, outputs[0][:, problem.channels.index(CURRENT), : BEGUN_STEP.rows]):
        return 0
    resting = replace(problem, start=replace(problem.start, speed=0.0))
    lead = max(1, round(BEGUN_STEP.sooner / interval))
    before = problem.driving.beginning(-lead * interval, lead + driving.samples)
    outputs.append(first_rows(resting, driving, angle, faults))
    outputs.append(first_rows(resting, before, angle, faults)[:, :, lead:])
    rows = rows_apart(problem, outputs)
    return rows if leaves_enough(problem, rows) else 0


def _is_on_command(problem: Problem) -> bool:
    """Return whether the manoeuvre starts on the command."""
    first = float(problem.driving.command(np.zeros(1))[0])
    return bool(np.isclose(problem.start.angle * problem.actuator.mechanics.gear_ratio, first))


def _is_current_of_models(problem: Problem, currents: Array) -> bool:
    """Return whether the first rows of the current are consistent with the `currents` (n, rows) of n models.

    The recorded current initially rises slightly later than that of an averaged model. It exceeds that of a
    model at rest if the step was before the recording. If models start with the speed from the position, it
    must not be smaller than theirs either.
    """
    sign = float(np.sign(currents.sum()))
    recorded, models = sign * problem.measured[CURRENT][: currents.shape[1]], sign * currents
    noise = noise_on_most_rows(problem.measured[CURRENT])
    by_noise = BEGUN_STEP.significant * max(noise, problem.counts.get(CURRENT, 0.0))
    least = max(by_noise, BEGUN_STEP.resolved * float(np.abs(currents).max()))
    if np.any(recorded > models.max(axis=0) + least):
        return False
    return not problem.start.speed or bool(np.all(recorded >= models.min(axis=0) - least))
