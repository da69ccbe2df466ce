"""Rows at the start of a recording that begins at a rest after a motion, in which friction holds the shaft.

A model starts on the command, and draws no current until this moves, or what the load asks for. A shaft that
has moved before stands where friction stopped it, somewhat off the command, and its drive draws current
against that friction. Its mean says nothing of the faults, and nothing of the sensor's zero.
"""

import math
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.first_rows import (
    first_rows,
    least_residual,
    likely_faults,
    longest_delay,
    rows_apart,
)
from emaphm.estimation.rows.gap_side import (
    at_side,
    leaves_enough,
    motion_after,
    rows_of_unknown_side,
    shows_side,
    side_of,
)
from emaphm.estimation.rows.moving_start import residual_after_motion
from emaphm.recording.noise import noise_level, noise_on_most_rows


@dataclass(frozen=True)
class HeldStartSettings:
    """When a shaft is taken to be held at the start, and which rows are then not compared.

    The command stands while it is within `still` of its range, or `noise` times its noise, from its first
    value; the rest is looked at over `fewest` rows at least, and `longest` [s] at most. If it is shorter than
    `sure` [s] and `fewest` rows, and the current no more than the range of those of models with likely faults
    outside of it, a model that starts off the command must leave less than `better` times the rms residual of
    the one on it.
    Its mean current is not the model's if it is outside those of models with likely faults by `significant`
    standard errors, or by as many times the share `resolved` of the current's scatter; unless all of these go
    the share `leaves` of the way from where the shaft was recorded to the command.

    Rows are left out until a model that starts on the command and one that starts off it no longer differ:
    off by what makes the recorded current, and `further` than that, as switching draws less current than the
    mean model does near to zero. The `small` share of the command's range shows what a distance makes.
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
    further: float = 2.0
    small: float = 1e-6
    better: float = 0.85


HELD_START = HeldStartSettings()

CURRENT = "current_A"


@dataclass(frozen=True)
class HeldStart:
    """The first `rows` depend on where friction holds the shaft, by a `current` [A] that no model draws.

    The shaft `stands` there if that explains the first rows better than a motion before does.
    """

    rows: int
    current: float
    stands: bool


def held_start(problem: Problem) -> HeldStart | None:
    """Return how friction holds the shaft at the start, None where it does not.

    It does where the current of a first rest is none that a model draws which starts on the command. The
    rows are the rest, and what follows until the start does not matter. Where too little motion would be
    left, they are the rest alone, or 0 if its current is more than friction holds. The command may begin to
    move at once, as long as it begins slowly.
    """
    rest, faults = _standing_rows(problem), likely_faults(problem)
    current, certain = current_not_drawn(problem)
    if not current:
        return None
    certain = certain or _is_sure_rest(problem, rest)
    count = _rows_until_forgotten(problem, rest, current, faults, certain=certain)
    if count is None:
        return None
    stands = _stands(problem, current, faults)
    if leaves_enough(problem, count):
        return HeldStart(count, current, stands)
    # After a step friction may hold the shaft elsewhere again, and the start is never forgotten.
    alone = _friction_holds(problem, current) and leaves_enough(problem, rest - 1)
    return HeldStart(rest if alone else 0, current, stands)


def _stands(problem: Problem, current: float, faults: Array) -> bool:
    """Return whether models held by friction, or by a load of this `current` [A], are nearer than others.

    Than those that have moved, over the first rows, in which such a shaft would come to rest.
    """
    if problem.start.speed and "speed_rad_s" in problem.measured:
        return False
    rows = min(problem.samples, max(math.ceil(HELD_START.shortest / problem.inputs.interval), 1))
    standing = problem.driving.beginning(0.0, rows)
    held = min(
        least_residual(problem, one, 0, rows) for one in _from_starts(problem, standing, current, faults)
    )
    return held <= HELD_START.better * residual_after_motion(problem, rows)


def _friction_holds(problem: Problem, current: float) -> bool:
    """Return whether healthy static friction holds the shaft against a `current` [A]: else it is a load's."""
    actuator = problem.actuator
    return abs(current) * actuator.motor.torque_constant <= actuator.mechanics.static_friction


def command_stands(problem: Problem) -> bool:
    """Return whether the command stands at first, for longer than one that begins slowly may seem to."""
    return _is_sure_rest(problem, _standing_rows(problem))


def current_not_drawn(problem: Problem) -> tuple[float, bool]:
    """Return by what the mean current at the start is off that of models which start on the command [A].

    And whether it is farther off than those of models with likely faults are from each other. 0 where it is
    among these, or the shaft was recorded at a place where none of them stays.
    """
    rest, fewest = _standing_rows(problem), _fewest_rows(problem)
    if CURRENT not in problem.channels or not fewest <= problem.samples > rest:
        return 0.0, False
    longest, faults = math.ceil(HELD_START.longest / problem.inputs.interval), likely_faults(problem)
    standing = problem.driving.beginning(0.0, max(min(rest, longest), fewest))
    drawn = first_rows(problem, standing, _on_command(problem, standing), faults)
    means = drawn[:, problem.channels.index(CURRENT)].mean(axis=1)
    current = float(problem.measured[CURRENT][: standing.samples].mean())
    outside = max(float(means.min()) - current, current - float(means.max()))
    if outside <= _least_current(problem, standing.samples) or _leaves_its_start(problem, standing, faults):
        return 0.0, False
    return current - float(np.median(means)), outside > float(np.ptp(means))


def _fewest_rows(problem: Problem) -> int:
    """Return over how many rows a rest is looked at, at least: more than the sensors are late."""
    return HELD_START.fewest + math.ceil(longest_delay(problem) / problem.inputs.interval)


def _rows_until_forgotten(
    problem: Problem, rest: int, current: float, faults: Array, *, certain: bool
) -> int | None:
    """Return the rows of a `rest` with a held `current` [A], and of the motion after it that depend on it.

    None where the rows rather show a start on the command, and the held current is not `certain`.
    """
    moving, lead = _motion_after(problem, rest)
    outputs = _from_starts(problem, moving, current, faults)
    apart = rows_apart(problem, outputs)
    if not certain:
        on, *off = (least_residual(problem, one, rest - lead, max(apart, 1)) for one in outputs)
        if min(off) > HELD_START.better * on:
            return None
    if not shows_side(problem):
        apart = max(apart, rows_of_unknown_side(problem, moving))
    return rest + max(apart - lead, 0)


def _motion_after(problem: Problem, rest: int) -> tuple[DrivingSignals, int]:
    """Return the signals of the motion after the `rest` rows, and how many rows of the rest they begin with.

    From the last rows of the rest on: a model that starts sooner may have crept back to the command.
    """
    lead = min(math.ceil(HELD_START.shortest / problem.inputs.interval), rest)
    return motion_after(problem, rest, lead), lead


def _is_sure_rest(problem: Problem, rest: int) -> bool:
    """Return whether a `rest` of this many rows is more than a slow beginning of the motion may look like."""
    return rest >= max(HELD_START.sure / problem.inputs.interval, HELD_START.fewest)


def _leaves_its_start(problem: Problem, driving: DrivingSignals, faults: Array) -> bool:
    """Return whether no model that starts where the shaft was recorded stays there.

    Then the command had not been reached; the current of a shaft that stays is friction's.
    """
    off = abs(problem.start.angle - _on_command(problem, driving)) * problem.actuator.mechanics.gear_ratio
    if not off:
        return False
    positions = first_rows(problem, driving, problem.start.angle, faults, ("position_rad",))
    return bool(np.ptp(positions, axis=2).min() > HELD_START.leaves * off)


def _on_command(problem: Problem, driving: DrivingSignals) -> float:
    """Return the motor's angle on the command at the beginning of the `driving` signals [rad]."""
    return float(driving.command(np.zeros(1))[0]) / problem.actuator.mechanics.gear_ratio


def _standing_rows(problem: Problem) -> int:
    """Return the rows before the command moves, all of them where it never does."""
    command = problem.measured["command_rad"]
    first = command[: max(round(2 * HELD_START.shortest / problem.inputs.interval), 4 * HELD_START.fewest)]
    least = max(HELD_START.still * float(np.ptp(command)), HELD_START.noise * noise_level(first))
    moved = np.abs(command - command[0]) > least
    return int(np.argmax(moved)) if moved.any() else command.size


def _least_current(problem: Problem, rows: int) -> float:
    """Return by what the mean current of `rows` must be off a model's to be that of a held shaft [A]."""
    current = problem.measured[CURRENT]
    error = max(noise_on_most_rows(current) / math.sqrt(rows), HELD_START.resolved * float(current.std()))
    return max(HELD_START.significant * error, problem.counts.get(CURRENT, 0.0) / 2)


def _from_starts(problem: Problem, driving: DrivingSignals, current: float, faults: Array) -> list[Array]:
    """Return the channels (n, channels, rows) of models that start on the command and off it.

    Off by what makes them draw about `current` [A] more, and further.
    """
    ratio, on = problem.actuator.mechanics.gear_ratio, _on_command(problem, driving)
    small = HELD_START.small * float(np.ptp(problem.measured["command_rad"])) / ratio
    outputs = [first_rows(problem, driving, on + off, faults) for off in (0.0, small)]
    problem = at_side(problem, side_of(current))
    stiffness = np.abs(outputs[1] - outputs[0])[:, problem.channels.index(CURRENT)].max() / small
    if not stiffness:
        return outputs
    starts = [on - off * current / stiffness for off in (1.0, HELD_START.further)]
    return [outputs[0], *(first_rows(problem, driving, start, faults) for start in starts)]
