"""Rows at the start of a recording that begins while the shaft is on its way to a command that stands.

A coarse position shows that the command has not been reached, and no speed: a model starts there at rest. If
the step was a row before, the current has risen meanwhile and the shaft has begun to move; the response is
right but for its moment, until it has settled.
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
    """When a step has begun before the recording.

    Where one of the first `rows` of the current is beyond those of models with likely faults by `significant`
    times its noise, and by the share `resolved` of the largest: a drive that switches swings about its limit.
    Rows are left out until models no longer differ that start with the speed that the
    position shows, at rest, and at rest `sooner` [s].
    """

    rows: int = 5
    significant: float = 3.0
    resolved: float = 0.05
    sooner: float = 1e-3


BEGUN_STEP = BegunStepSettings()


def rows_of_begun_step(problem: Problem) -> int:
    """Return how many rows depend on when a step was that the shaft still follows, 0 where it begins at rest.

    And where the speed was recorded, or too little motion would be left.
    """
    known = "speed_rad_s" in problem.measured and problem.start.speed
    if CURRENT not in problem.channels or known or _is_on_command(problem):
        return 0
    faults, interval, angle = likely_faults(problem), problem.inputs.interval, problem.start.angle
    driving = motion_after(problem)
    outputs = [first_rows(problem, driving, angle, faults)]
    if _draws(problem, outputs[0][:, problem.channels.index(CURRENT), : BEGUN_STEP.rows]):
        return 0
    resting = replace(problem, start=replace(problem.start, speed=0.0))
    lead = max(1, round(BEGUN_STEP.sooner / interval))
    before = problem.driving.beginning(-lead * interval, lead + driving.samples)
    outputs.append(first_rows(resting, driving, angle, faults))
    outputs.append(first_rows(resting, before, angle, faults)[:, :, lead:])
    rows = rows_apart(problem, outputs)
    return rows if leaves_enough(problem, rows) else 0


def _is_on_command(problem: Problem) -> bool:
    first = float(problem.driving.command(np.zeros(1))[0])
    return bool(np.isclose(problem.start.angle * problem.actuator.mechanics.gear_ratio, first))


def _draws(problem: Problem, currents: Array) -> bool:
    """Return whether the first rows of the current may be those of n models, (n, rows).

    At first it rises a little later than a mean model's. It is ahead of one at rest if the step was before;
    where models start with a speed that the position shows, it must not be behind either.
    """
    way = float(np.sign(currents.sum()))
    ahead, models = way * problem.measured[CURRENT][: currents.shape[1]], way * currents
    noise = noise_on_most_rows(problem.measured[CURRENT])
    known = BEGUN_STEP.significant * max(noise, problem.counts.get(CURRENT, 0.0))
    least = max(known, BEGUN_STEP.resolved * float(np.abs(currents).max()))
    if np.any(ahead > models.max(axis=0) + least):
        return False
    return not problem.start.speed or bool(np.all(ahead >= models.min(axis=0) - least))
