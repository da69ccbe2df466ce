"""Rows at the start of a recording that was cut within a motion, whose beginning nothing recorded shows.

Without a position a model starts on the command, and without a speed at rest; a coarse position shows no
speed. Where the command moves in the first row already, the shaft does not rest there: it moves, and lags
behind. The loop forgets that within some tens of milliseconds; until then the model is wrong whatever the
faults.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array, rms
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.first_rows import first_rows, least_residual, likely_faults, rows_apart


@dataclass(frozen=True)
class MovingStartSettings:
    """When a recording starts within a motion, and which rows are then not compared.

    The command moves if its rate over the first `window` [s] is above `moving` times the rms of its rate, and
    the parabola through that window is right `at_once` [s] later, to the share `off` of the way by its rate.
    The motion before the recording is simulated over `lead` [s] of the command, extended backwards by that
    parabola. From rest, the model must leave less than `rest` times the rms residual that it leaves with the
    motion before, if the recording is to start at rest. Of 12 chirps with random faults, by a simulator that
    is not part of the project, none passes for a cut one, and of 228 recordings cut out of them none for one
    from rest; from the current alone 4, begun near a turn of the command.

    Rows are left out while both differ, up to `most` of all rows. They are compared over `longest` [s] at
    most.
    """

    window: float = 0.01
    moving: float = 0.01
    at_once: float = 2e-3
    off: float = 0.25
    lead: float = 0.03
    rest: float = 0.75
    most: float = 0.5
    longest: float = 1.0


MOVING_START = MovingStartSettings()


def command_moves(problem: Problem) -> bool:
    """Return whether the command moves in the first row already.

    A parabola through a command that stands for a while, or begins as smoothly as a cubic, has a rate at the
    start that the command has not: it must not be off the parabola by half of the way that this rate makes.
    """
    rate, acceleration = first_motion(problem)
    rates = np.diff(problem.measured["command_rad"]) / problem.inputs.interval
    if abs(rate) <= MOVING_START.moving * rms(rates):
        return False
    at_once = max(MOVING_START.at_once, problem.inputs.interval)
    begin, end = problem.driving.command(np.array([0.0, at_once]))
    off = end - begin - rate * at_once - acceleration * at_once**2 / 2
    return bool(abs(off) < MOVING_START.off * abs(rate) * at_once)


def first_motion(problem: Problem) -> tuple[float, float]:
    """Return rate and acceleration of the command at the start [rad/s, rad/s²]."""
    return _parabola(problem)[1:]


def rows_of_moving_start(problem: Problem) -> int:
    """Return how many rows at the start depend on the motion before it, of a command that moves there.

    Of a recording that does not show its start: `emaphm.estimation.initial_state.shows_start`.
    """
    driving, interval = problem.driving, problem.inputs.interval
    rows = min(problem.samples, max(1, math.ceil(MOVING_START.longest / interval)))
    lead = math.ceil(MOVING_START.lead / interval)
    faults = likely_faults(problem)
    at_rest = first_rows(problem, driving.beginning(0.0, rows), problem.start.angle, faults)
    before, angle = _with_motion_before(problem, lead, rows)
    moving = first_rows(problem, before, angle, faults)[:, :, lead:]
    count = rows_apart(problem, [at_rest, moving])
    if not count:
        return 0
    left = [least_residual(problem, one, 0, count) for one in (at_rest, moving)]
    if left[0] < MOVING_START.rest * left[1]:
        return 0
    return min(count, int(MOVING_START.most * problem.samples))


def _with_motion_before(problem: Problem, lead: int, rows: int) -> tuple[DrivingSignals, float]:
    """Return the signals with `lead` rows of motion before `rows`, and the motor's angle [rad] there."""
    begin = lead * problem.inputs.interval
    position, rate, acceleration = _parabola(problem)
    lowest, highest = problem.actuator.mechanics.end_stops or (-np.inf, np.inf)

    def command(times: Array) -> Array:
        since = times - begin
        before = np.clip(position + rate * since + acceleration * since**2 / 2, lowest, highest)
        return np.where(since < 0, before, problem.driving.command(np.maximum(since, 0.0)))

    driving = replace(problem.driving.beginning(-begin, lead + rows), command=command)
    ratio = problem.actuator.mechanics.gear_ratio
    first = problem.start.angle * ratio + float(command(np.zeros(1))[0]) - position
    return driving, float(np.clip(first, lowest, highest)) / ratio


def _parabola(problem: Problem) -> tuple[float, float, float]:
    """Return position, rate and acceleration of the command at the start [rad, rad/s, rad/s²]."""
    window = max(MOVING_START.window, 3 * problem.inputs.interval)
    times = np.linspace(0.0, window, 21)
    values = problem.driving.command(times)
    terms = np.stack([times, times**2 / 2], axis=1)
    (rate, acceleration), *_ = np.linalg.lstsq(terms, values - values[0], rcond=None)
    return float(values[0]), float(rate), float(acceleration)
