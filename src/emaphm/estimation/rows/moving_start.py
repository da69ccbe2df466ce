"""Rows at the start of a recording that was cut within a motion, whose beginning nothing recorded shows.

Without a position a model starts on the command, and without a speed at rest; a coarse position shows no
speed. Where the command moves in the first row already, or has just turned or stopped, the shaft does not
rest on it: it moves, and lags behind. The loop forgets that within some tens of milliseconds; until then the
model is wrong whatever the faults.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array, rms
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.first_rows import (
    first_rows,
    least_residual,
    likely_faults,
    longest_delay,
    noise_residual,
    rows_apart,
)
from emaphm.estimation.rows.gap_side import FIRST_MOTION, side_of
from emaphm.estimation.sensors.counts import ROUNDING, visible_count
from emaphm.recording.jumps import Jumps
from emaphm.recording.noise import noise_on_most_rows


@dataclass(frozen=True)
class MovingStartSettings:
    """When a recording starts within a motion, and which rows are then not compared.

    The command moves in the first row if its rate there is above `moving` times the rms of its rate, and
    above `significant` standard errors. That is the rate at the start of a parabola through three blocks of
    rows, as many as the noise asks for, up to `window` [s]; from the first block to the second the command
    must move by `alike` times as much as this rate says, or it stands at first, and moves then.

    The motion before the recording is simulated over `lead` [s] of the command, extended backwards by a
    parabola through the first `window`, and by lines: at the rate of the first row, and at the opposite one,
    as it may just have turned. Where it does not move, at the shares `stopped` of the rms of its rate. Where
    it moves, models from rest must leave less than `rest` times the rms residual that they leave with any
    motion before, if the recording is to start at rest; where it does not, the other way round. Residuals are
    those of the first rows, over `shows` [s]: later ones show less of the start, and more of other faults
    than these models have. Of 200 recordings from rest with random faults (base setting) 11 seemed to move by
    20 ms of them, none by 5.

    Rows are left out while they differ, up to `most` of all rows. They are compared over `longest` [s] at
    most, and where the command does not move over `FIRST_MOTION.longest`.
    """

    window: float = 0.01
    moving: float = 0.01
    significant: float = 3.0
    alike: tuple[float, float] = (0.5, 1.5)
    stopped: tuple[float, ...] = (0.5, 1.0, 1.5)
    lead: float = 0.03
    rest: float = 0.75
    shows: float = 5e-3
    most: float = 0.5
    longest: float = 1.0


MOVING_START = MovingStartSettings()


def command_moves(problem: Problem) -> bool:
    """Return whether the command moves in the first row already.

    One that stands for a row and then moves does not, nor one that begins as smoothly as a square.
    """
    return first_rate(problem) != 0.0


def first_rate(problem: Problem) -> float:
    """Return the rate of the command from the first row on [rad/s], 0 where it does not move there."""
    command, interval = problem.measured["command_rad"], problem.inputs.interval
    jumps = _jumps_of(problem)
    if _jump_at_once(jumps):
        return 0.0
    least = MOVING_START.moving * _usual_rate(problem, jumps)
    noise = max(noise_on_most_rows(command), visible_count(command) / ROUNDING)
    most = max(1, min(round(MOVING_START.window / interval), command.size) // 3)
    for rows in range(1, most + 1):
        # Of a block, a mean over its rows; the rate at the start is (-3, 4, -1) / 2 times the blocks.
        error = MOVING_START.significant * noise * (26 / rows) ** 0.5 / (2 * rows * interval)
        if error <= least or rows == most:
            break
    first, second, third = command[: 3 * rows].reshape(3, rows).mean(axis=1)
    begins = (4 * second - third - 3 * first) / (2 * rows * interval)
    rate = (second - first) / (rows * interval)
    if abs(begins) <= max(least, error):
        return 0.0
    low, high = MOVING_START.alike
    return float(rate) if low <= rate / begins <= high else 0.0


def _jump_at_once(jumps: Jumps) -> bool:
    """Return whether the command jumps in the first row: then it shows what the shaft follows."""
    return bool(np.any(jumps.before == 0))


def _jumps_of(problem: Problem) -> Jumps:
    return Jumps.of(problem.measured["command_rad"], means=problem.driving.sampling == "mean")


def _usual_rate(problem: Problem, jumps: Jumps) -> float:
    """Return the rms of the command's rate where it does not jump [rad/s]."""
    rates = np.diff(problem.measured["command_rad"]) / problem.inputs.interval
    for before, after in zip(jumps.before, jumps.after, strict=True):
        rates[before:after] = 0.0
    return rms(rates)


def first_motion(problem: Problem) -> tuple[float, float]:
    """Return rate and acceleration of the command at the start [rad/s, rad/s²]."""
    window = max(MOVING_START.window, 3 * problem.inputs.interval)
    times = np.linspace(0.0, window, 21)
    values = problem.driving.command(times)
    terms = np.stack([times, times**2 / 2], axis=1)
    (rate, acceleration), *_ = np.linalg.lstsq(terms, values - values[0], rcond=None)
    return float(rate), float(acceleration)


def rows_of_moving_start(problem: Problem, *, moves: bool) -> tuple[int, float]:
    """Return how many rows at the start depend on the motion before it, and at which side of the gap it was.

    0 rows where the recording starts from rest. Of one that does not show its start
    (`emaphm.estimation.initial_state.shows_start`). Where the command does not move there (`command_moves`),
    models in motion must be nearer by `MOVING_START.rest`; where it `moves`, those from rest.
    """
    faults = likely_faults(problem)
    if not moves and (_jump_at_once(_jumps_of(problem)) or _rest_leaves_noise(problem, faults)):
        return 0, 0.0
    motions = motions_before(problem)
    if not any(rate for rate, _ in motions):
        return 0, 0.0
    longest = MOVING_START.longest if moves else FIRST_MOTION.longest
    rows = min(problem.samples, max(1, math.ceil(longest / problem.inputs.interval)))
    at_rest = _from_rest(problem, rows, faults)
    moving = [_after_motion(problem, motion, rows, faults) for motion in motions]
    count = rows_apart(problem, [*at_rest, *moving])
    if not count:
        return 0, 0.0
    shown = min(count, _shown_rows(problem))
    left = [least_residual(problem, one, 0, shown) for one in moving]
    share = MOVING_START.rest if moves else 1 / MOVING_START.rest
    if min(least_residual(problem, one, 0, shown) for one in at_rest) <= share * min(left):
        return 0, 0.0
    side = side_of(motions[int(np.argmin(left))][0])
    return min(count, int(MOVING_START.most * problem.samples)), side


def _shown_rows(problem: Problem) -> int:
    """Return the number of first rows that show the start: a sensor shows it after its delay."""
    seconds = MOVING_START.shows + longest_delay(problem)
    return min(problem.samples, max(1, math.ceil(seconds / problem.inputs.interval)))


def _rest_leaves_noise(problem: Problem, faults: Array) -> bool:
    """Return whether models from rest leave so little of the first rows that none in motion can be nearer."""
    rows = _shown_rows(problem)
    left = min(least_residual(problem, one, 0, rows) for one in _from_rest(problem, rows, faults))
    return left <= noise_residual(problem) / MOVING_START.rest


def _from_rest(problem: Problem, rows: int, faults: Array) -> list[Array]:
    """Return the channels (n, channels, rows) of models that rest: where the position shows, on the command.

    A position may show the zero error of its sensor, and the shaft rest on the command all the same.
    """
    driving = problem.driving.beginning(0.0, rows)
    on_command = float(driving.command(np.zeros(1))[0]) / problem.actuator.mechanics.gear_ratio
    return [first_rows(problem, driving, angle, faults) for angle in {problem.start.angle, on_command}]


def residual_after_motion(problem: Problem, rows: int) -> float:
    """Return the least rms residual over the first `rows` of models that have moved before the recording."""
    faults = likely_faults(problem)
    return min(
        least_residual(problem, _after_motion(problem, motion, rows, faults), 0, rows)
        for motion in motions_before(problem)
    )


def motions_before(problem: Problem) -> list[tuple[float, float]]:
    """Return rates [rad/s] and accelerations [rad/s²] that the command may have had before the recording."""
    rate = first_rate(problem)
    rates = [rate]
    if not rate:
        usual = _usual_rate(problem, _jumps_of(problem))
        rates = [share * usual for share in MOVING_START.stopped]
    return [first_motion(problem), *((way * one, 0.0) for one in rates for way in (1.0, -1.0))]


def _after_motion(problem: Problem, motion: tuple[float, float], rows: int, faults: Array) -> Array:
    """Return the channels (n, channels, rows) of models with a `motion` of the command before them."""
    lead = math.ceil(MOVING_START.lead / problem.inputs.interval)
    driving, angle = _with_motion_before(problem, motion, lead, rows)
    return first_rows(problem, driving, angle, faults)[:, :, lead:]


def _with_motion_before(
    problem: Problem, motion: tuple[float, float], lead: int, rows: int
) -> tuple[DrivingSignals, float]:
    """Return the signals with `lead` rows of a `motion` before `rows`, and the motor's angle [rad] there."""
    begin = lead * problem.inputs.interval
    position, (rate, acceleration) = float(problem.driving.command(np.zeros(1))[0]), motion
    lowest, highest = problem.actuator.mechanics.end_stops or (-np.inf, np.inf)

    def command(times: Array) -> Array:
        since = times - begin
        before = np.clip(position + rate * since + acceleration * since**2 / 2, lowest, highest)
        return np.where(since < 0, before, problem.driving.command(np.maximum(since, 0.0)))

    driving = replace(problem.driving.beginning(-begin, lead + rows), command=command)
    ratio = problem.actuator.mechanics.gear_ratio
    first = problem.start.angle * ratio + float(command(np.zeros(1))[0]) - position
    return driving, float(np.clip(first, lowest, highest)) / ratio
