"""Rows at the start of a recording that begins at a rest after a motion, in which friction holds the shaft.

A model starts on the command, and draws no current until this moves. A shaft that has moved before stands
where friction stopped it, somewhat off the command, and its drive draws current against that friction. Its
mean says nothing of the faults, and nothing of the sensor's zero.
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.rows.first_rows import first_rows, likely_faults, rows_apart
from emaphm.recording.noise import noise_level, noise_on_most_rows

if TYPE_CHECKING:
    from emaphm.estimation.problem import Problem

STANDS = 1e-3
"""Of its range, what the command may move by and still stands."""

SHORTEST_S = 10e-3
"""Shortest rest that is looked at [s]: what the current is in a shorter one may still be settling."""

LONGEST_S = 1.0
"""Longest part of the rest that a model is compared over [s], and of the motion after it."""

SIGNIFICANT = 3.0
"""Standard errors, and hundredths of its rms, by which the mean current is off what a model draws."""

SMALL = 1e-6
"""Distance from the command, over its range, that shows what current a distance makes."""

OFF = (1.0, 2.0)
"""Distances from the command that the shaft may start at, over that which makes the recorded current.

Switching draws less current than the mean model does so near to zero.
"""


def rows_of_held_start(problem: "Problem") -> int:
    """Return how many rows at the start depend on where friction holds the shaft, 0 where it holds nothing.

    The rest, while the command stands, and what follows until the start does not matter.
    """
    name, interval = "current_A", problem.inputs.interval
    rest = _standing_rows(problem)
    if name not in problem.channels or not SHORTEST_S / interval <= rest < problem.samples:
        return 0
    faults, driving, angle = likely_faults(problem), problem.driving, problem.start.angle
    looked_at = min(rest, math.ceil(LONGEST_S / interval))
    current = problem.measured[name][:looked_at]
    drawn = first_rows(problem, driving.beginning(0.0, looked_at), angle, faults)
    means = drawn[:, problem.channels.index(name)].mean(axis=1)
    off = float(np.min(np.abs(current.mean() - means)))
    if off <= _least_current(problem, name, looked_at):
        return 0
    # From the last rows of the rest on: a model that starts sooner may have crept back to the command.
    lead = math.ceil(SHORTEST_S / interval)
    rows = min(problem.samples - rest, math.ceil(LONGEST_S / interval))
    moving = driving.beginning((rest - lead) * interval, lead + rows)
    return rest + max(
        rows_apart(problem, _from_starts(problem, moving, float(current.mean()), faults)) - lead, 0
    )


def _standing_rows(problem: "Problem") -> int:
    """Return the rows before the command moves, all of them where it never does."""
    command = problem.measured["command_rad"]
    least = max(STANDS * float(np.ptp(command)), 2 * SIGNIFICANT * noise_level(command))
    moved = np.abs(command - command[0]) > least
    return int(np.argmax(moved)) if moved.any() else command.size


def _least_current(problem: "Problem", name: str, rows: int) -> float:
    """Return by what the mean current of `rows` must be off a model's to be that of a held shaft [A]."""
    current = problem.measured[name]
    error = max(noise_on_most_rows(current) / math.sqrt(rows), 0.01 * float(current.std()))
    return max(SIGNIFICANT * error, problem.counts.get(name, 0.0) / 2)


def _from_starts(problem: "Problem", driving: DrivingSignals, current: float, faults: Array) -> list[Array]:
    """Return the channels (n, channels, rows) of models that start on the command and off it.

    Off by what makes them draw about `current` [A], and by other multiples of that.
    """
    name, ratio = "current_A", problem.actuator.mechanics.gear_ratio
    on = float(driving.command(np.zeros(1))[0]) / ratio
    small = SMALL * float(np.ptp(problem.measured["command_rad"])) / abs(ratio)
    outputs = [first_rows(problem, driving, on + off, faults) for off in (0.0, small)]
    stiffness = np.abs(outputs[1] - outputs[0])[:, problem.channels.index(name)].max() / small
    angles = [on - math.copysign(off * current / stiffness, ratio) for off in OFF] if stiffness else []
    return [outputs[0], *(first_rows(problem, driving, angle, faults) for angle in angles)]
