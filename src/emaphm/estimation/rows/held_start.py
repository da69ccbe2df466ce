"""Rows at the start of a recording that begins at a rest after a motion, in which friction holds the shaft.

A model starts on the command and draws only the current for the load until the command moves. A shaft that
has moved before stands at a distance from the command, where friction stopped it, and its drive draws a
current against that friction. The mean of this current contains no information on the faults or on the
sensor's zero.
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
    """Settings of the detection of a shaft held by friction at the start, and of the rows left out.

    The command stands while it is within `still` of its range, or `noise` times its noise, from its first
    value; the rest is evaluated over at least `fewest` rows and at most `longest` [s].

    The mean current is not the model's if it is outside the range of models with likely faults by more than
    `significant` standard errors, and by more than `significant` times the share `resolved` of the current's
    standard deviation. This does not apply if all of these models, started at the recorded position, move by
    the share `leaves` of the distance to the command. If the rest is shorter than `sure` [s] or `fewest`
    rows, and the current is outside that range by no more than its width, a model that starts at a distance
    from the command must also have less than `better` times the rms residual of a model on the command.

    Rows are left out until a model that starts on the command and models that start at a distance from it no
    longer differ. The distances are that of the recorded current and `further` times that distance, because
    near zero, switching draws less current than the averaged model. The current per distance is determined at
    the `small` share of the command's range.
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

ROUNDED = 1e-9
"""Change of a current, relative to its largest value, up to which it is a rounding error."""


@dataclass(frozen=True)
class HeldStart:
    """A start at which friction may hold the shaft, indicated by a `current` [A] that no model draws.

    The first `rows` depend on the position of the shaft. The shaft `stands` if this explains the first rows
    better than a motion before the recording.
    """

    rows: int
    current: float
    stands: bool


def held_start(problem: Problem) -> HeldStart | None:
    """Return the held start of the recording, None if the shaft is not held.

    The shaft is held if no model that starts on the command draws the current of an initial rest. The rows
    are the rest, and the rows after it until the start no longer has an effect. If too little motion would
    remain, they are the rest alone, or 0 if its current exceeds static friction. The command may move from
    the first row on if it begins slowly.
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
    # After a step, friction may hold the shaft at another position, and the effect of the start remains.
    rest_alone = _friction_holds(problem, current) and leaves_enough(problem, rest - 1)
    return HeldStart(rest if rest_alone else 0, current, stands)


def _stands(problem: Problem, current: float, faults: Array) -> bool:
    """Return whether models held by friction, or by a load of this `current` [A], fit better than moving.

    They are compared over the first rows, in which a moving shaft would come to rest.
    """
    if problem.start.speed and "speed_rad_s" in problem.measured:
        return False
    rows = min(problem.samples, max(math.ceil(HELD_START.shortest / problem.inputs.interval), 1))
    standing = problem.driving.beginning(0.0, rows)
    held_residual = min(
        least_residual(problem, outputs, 0, rows)
        for outputs in _from_starts(problem, standing, current, faults)
    )
    return held_residual <= HELD_START.better * residual_after_motion(problem, rows)


def _friction_holds(problem: Problem, current: float) -> bool:
    """Return whether healthy static friction, and not a load, holds the shaft against a `current` [A]."""
    actuator = problem.actuator
    return abs(current) * actuator.motor.torque_constant <= actuator.mechanics.static_friction


def command_stands(problem: Problem) -> bool:
    """Return whether the command initially stands, for longer than a slow beginning could appear to stand."""
    return _is_sure_rest(problem, _standing_rows(problem))


def current_not_drawn(problem: Problem) -> tuple[float, bool]:
    """Return the deviation [A] of the initial mean current from that of models that start on the command.

    The second value states whether the deviation exceeds the range of models with likely faults. The
    deviation is 0 if the current is within this range, or if no model stays at the recorded position.
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
    """Return the least number of rows over which a rest is evaluated: more than the delay of the sensors."""
    return HELD_START.fewest + math.ceil(longest_delay(problem) / problem.inputs.interval)


def _rows_until_forgotten(
    problem: Problem, rest: int, current: float, faults: Array, *, certain: bool
) -> int | None:
    """Return the number of rows of a `rest` with a held `current` [A] and of the motion that depends on it.

    None if the held current is not `certain`, and the rows rather indicate a start on the command.
    """
    moving, lead = _motion_after(problem, rest)
    outputs = _from_starts(problem, moving, current, faults)
    differing = rows_apart(problem, outputs)
    if not certain:
        on_command, *off_command = (
            least_residual(problem, start, rest - lead, max(differing, 1)) for start in outputs
        )
        if min(off_command) > HELD_START.better * on_command:
            return None
    if not shows_side(problem):
        differing = max(differing, rows_of_unknown_side(problem, moving))
    return rest + max(differing - lead, 0)


def _motion_after(problem: Problem, rest: int) -> tuple[DrivingSignals, int]:
    """Return the signals of the motion after `rest` rows, and the number of rows of the rest they begin with.

    They begin with the last rows of the rest: a model that starts earlier may creep back to the command.
    """
    lead = min(math.ceil(HELD_START.shortest / problem.inputs.interval), rest)
    return motion_after(problem, rest, lead), lead


def _is_sure_rest(problem: Problem, rest: int) -> bool:
    """Return whether a `rest` of this many rows is longer than a slow beginning could appear to stand."""
    return rest >= max(HELD_START.sure / problem.inputs.interval, HELD_START.fewest)


def _leaves_its_start(problem: Problem, driving: DrivingSignals, faults: Array) -> bool:
    """Return whether every model that starts at the recorded position moves away from it.

    In that case the command had not been reached; the current of a shaft that stays is due to friction.
    """
    distance = (
        abs(problem.start.angle - _on_command(problem, driving)) * problem.actuator.mechanics.gear_ratio
    )
    if not distance:
        return False
    positions = first_rows(problem, driving, problem.start.angle, faults, ("position_rad",))
    return bool(np.ptp(positions, axis=2).min() > HELD_START.leaves * distance)


def _on_command(problem: Problem, driving: DrivingSignals) -> float:
    """Return the motor's angle [rad] on the command at the beginning of the `driving` signals."""
    return float(driving.command(np.zeros(1))[0]) / problem.actuator.mechanics.gear_ratio


def _standing_rows(problem: Problem) -> int:
    """Return the number of rows before the command moves; all rows if it never moves."""
    command = problem.measured["command_rad"]
    first = command[: max(round(2 * HELD_START.shortest / problem.inputs.interval), 4 * HELD_START.fewest)]
    least = max(HELD_START.still * float(np.ptp(command)), HELD_START.noise * noise_level(first))
    moved = np.abs(command - command[0]) > least
    return int(np.argmax(moved)) if moved.any() else command.size


def _least_current(problem: Problem, rows: int) -> float:
    """Return the least deviation [A] of the mean current of `rows` from a model's that is significant."""
    current = problem.measured[CURRENT]
    error = max(noise_on_most_rows(current) / math.sqrt(rows), HELD_START.resolved * float(current.std()))
    return max(HELD_START.significant * error, problem.counts.get(CURRENT, 0.0) / 2)


def _from_starts(problem: Problem, driving: DrivingSignals, current: float, faults: Array) -> list[Array]:
    """Return the channels (n, channels, rows) of models that start on the command and at distances from it.

    At the first distance, they draw about `current` [A] more than on the command; the second distance is
    larger by the factor `HELD_START.further`. No start is beyond the end stops. Where the currents do not
    depend on the distance, for example at their limit, a small distance stands for all.
    """
    ratio, on_command = problem.actuator.mechanics.gear_ratio, _on_command(problem, driving)
    small = HELD_START.small * float(np.ptp(problem.measured["command_rad"])) / ratio
    outputs = [first_rows(problem, driving, on_command + distance, faults) for distance in (0.0, small)]
    problem = at_side(problem, side_of(current))
    drawn, drawn_away = (rows[:, problem.channels.index(CURRENT)] for rows in outputs)
    change = float(np.abs(drawn_away - drawn).max())
    if change <= ROUNDED * float(np.abs(drawn).max()):
        return outputs
    lowest, highest = problem.actuator.mechanics.end_stops or (-np.inf, np.inf)
    starts = np.clip(
        [on_command - factor * current * small / change for factor in (1.0, HELD_START.further)],
        lowest / ratio,
        highest / ratio,
    )
    return [outputs[0], *(first_rows(problem, driving, float(start), faults) for start in starts)]
