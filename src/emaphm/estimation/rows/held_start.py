"""Rows at the start of a recording that begins at a rest after a motion, in which friction holds the shaft.

A model starts on the command, and draws no current until this moves, or what the load asks for. A shaft that
has moved before stands where friction stopped it, somewhat off the command, and its drive draws current
against that friction. Its mean says nothing of the faults, and nothing of the sensor's zero.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.rows.first_rows import first_rows, least_residual, likely_faults, rows_apart
from emaphm.recording.noise import noise_level, noise_on_most_rows

if TYPE_CHECKING:
    from emaphm.estimation.problem import Problem


@dataclass(frozen=True)
class HeldStartSettings:
    """When a shaft is taken to be held at the start, and which rows are then not compared.

    The command stands while it is within `still` of its range, or `noise` times its noise, from its first
    value; the rest is looked at over `fewest` rows at least, and `longest` [s] at most. If it is shorter than
    `sure` [s] and `fewest` rows, a model that starts off the command must leave less than `better` times the
    rms residual of the one on it.
    Its mean current is not the model's if it is outside those of models with likely faults by `significant`
    standard errors, or by as many times the share `resolved` of the current's scatter; unless all of these go
    the share `leaves` of the way from where the shaft was recorded to the command.

    Rows are left out until a model that starts on the command and one that starts off it no longer differ, up
    to `motion` [s] after the rest: off by what makes the recorded current, and `further` than that, as
    switching draws less current than the mean model does near to zero. The `small` share of the command's
    range shows what current a distance makes. The share `left` of the range must follow, or all is compared.
    """

    still: float = 1e-6
    noise: float = 6.0
    significant: float = 3.0
    shortest: float = 10e-3
    sure: float = 2e-3
    fewest: int = 5
    longest: float = 1.0
    resolved: float = 0.01
    leaves: float = 0.5
    motion: float = 0.25
    further: float = 2.0
    small: float = 1e-6
    better: float = 0.85
    left: float = 0.5


HELD_START = HeldStartSettings()

CURRENT = "current_A"


def rows_of_held_start(problem: "Problem") -> int | None:
    """Return how many rows at the start depend on where friction holds the shaft, None where it does not.

    It does where the current of a first rest is none that a model draws which starts on the command. The rows
    are the rest, and what follows until the start does not matter; 0 where too little motion would be left.
    The command may begin to move at once, as long as it begins slowly.
    """
    rest, fewest = _standing_rows(problem), _fewest_rows(problem)
    if CURRENT not in problem.channels or not fewest <= problem.samples > rest:
        return None
    longest, faults = math.ceil(HELD_START.longest / problem.inputs.interval), likely_faults(problem)
    rows = max(min(rest, longest), fewest)
    standing = problem.driving.beginning(0.0, rows)
    current = _current_not_drawn(problem, standing, faults)
    if not current or _leaves_its_start(problem, standing, faults):
        return None
    return _rows_until_forgotten(problem, rest, current, faults)


def _fewest_rows(problem: "Problem") -> int:
    """Return over how many rows a rest is looked at, at least: more than the sensors are late."""
    late = max(problem.actuator.sensors.of(name).delay for name in problem.channels)
    return HELD_START.fewest + math.ceil(late / problem.inputs.interval)


def _current_not_drawn(problem: "Problem", driving: DrivingSignals, faults: Array) -> float:
    """Return by what the mean current is off that of models which start on the command [A].

    0 where it is within those of models with likely `faults`.
    """
    drawn = first_rows(problem, driving, _on_command(problem, driving), faults)
    means = drawn[:, problem.channels.index(CURRENT)].mean(axis=1)
    current = float(problem.measured[CURRENT][: driving.samples].mean())
    least_off = _least_current(problem, driving.samples)
    if means.min() - least_off <= current <= means.max() + least_off:
        return 0.0
    return current - float(np.median(means))


def _rows_until_forgotten(problem: "Problem", rest: int, current: float, faults: Array) -> int | None:
    """Return the rows of a `rest` with a held `current` [A], and of the motion after it that depend on it.

    None where the rest is short, and the rows rather show a start on the command.
    """
    # From the last rows of the rest on: a model that starts sooner may have crept back to the command.
    interval = problem.inputs.interval
    lead = min(math.ceil(HELD_START.shortest / interval), rest)
    rows = min(problem.samples - rest, math.ceil(HELD_START.motion / interval))
    moving = problem.driving.beginning((rest - lead) * interval, lead + rows)
    outputs = _from_starts(problem, moving, current, faults)
    apart = rows_apart(problem, outputs)
    if rest < max(HELD_START.sure / interval, HELD_START.fewest):
        on, *off = (least_residual(problem, one, rest - lead, max(apart, 1)) for one in outputs)
        if min(off) > HELD_START.better * on:
            return None
    count = rest + max(apart - lead, 0)
    command = problem.measured["command_rad"]
    left = np.ptp(command[count:]) if count < problem.samples else 0.0
    return count if left >= HELD_START.left * np.ptp(command) else 0


def _leaves_its_start(problem: "Problem", driving: DrivingSignals, faults: Array) -> bool:
    """Return whether no model that starts where the shaft was recorded stays there.

    Then the command had not been reached; the current of a shaft that stays is friction's.
    """
    off = abs(problem.start.angle - _on_command(problem, driving)) * problem.actuator.mechanics.gear_ratio
    if not off:
        return False
    positions = first_rows(problem, driving, problem.start.angle, faults, ("position_rad",))
    return bool(np.ptp(positions, axis=2).min() > HELD_START.leaves * off)


def _on_command(problem: "Problem", driving: DrivingSignals) -> float:
    """Return the motor's angle on the command at the beginning of the `driving` signals [rad]."""
    return float(driving.command(np.zeros(1))[0]) / problem.actuator.mechanics.gear_ratio


def _standing_rows(problem: "Problem") -> int:
    """Return the rows before the command moves, all of them where it never does."""
    command = problem.measured["command_rad"]
    first = command[: max(round(2 * HELD_START.shortest / problem.inputs.interval), 4 * HELD_START.fewest)]
    least = max(HELD_START.still * float(np.ptp(command)), HELD_START.noise * noise_level(first))
    moved = np.abs(command - command[0]) > least
    return int(np.argmax(moved)) if moved.any() else command.size


def _least_current(problem: "Problem", rows: int) -> float:
    """Return by what the mean current of `rows` must be off a model's to be that of a held shaft [A]."""
    current = problem.measured[CURRENT]
    error = max(noise_on_most_rows(current) / math.sqrt(rows), HELD_START.resolved * float(current.std()))
    return max(HELD_START.significant * error, problem.counts.get(CURRENT, 0.0) / 2)


def _from_starts(problem: "Problem", driving: DrivingSignals, current: float, faults: Array) -> list[Array]:
    """Return the channels (n, channels, rows) of models that start on the command and off it.

    Off by what makes them draw about `current` [A] more, and further.
    """
    ratio, on = problem.actuator.mechanics.gear_ratio, _on_command(problem, driving)
    small = HELD_START.small * float(np.ptp(problem.measured["command_rad"])) / ratio
    outputs = [first_rows(problem, driving, on + off, faults) for off in (0.0, small)]
    stiffness = np.abs(outputs[1] - outputs[0])[:, problem.channels.index(CURRENT)].max() / small
    if not stiffness:
        return outputs
    starts = [on - off * current / stiffness for off in (1.0, HELD_START.further)]
    return [outputs[0], *(first_rows(problem, driving, start, faults) for start in starts)]
