"""Rows at the start of a recording that begins within a motion, if no recorded channel shows its start.

Without a position the model starts on the command, without a speed at rest; a coarse position shows no speed.
If the command already moves in the first row, or has just reversed or stopped, the shaft does not rest on the
command: it moves and lags behind. The transient of the control loop lasts some tens of milliseconds; during
this time the model is wrong for all faults.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array, rms
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.first_rows import (
    FORGOTTEN_S,
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
    """Settings of the detection of a start within a motion, and of the rows left out.

    The command moves in the first row if its rate there exceeds `moving` times its rms rate and `significant`
    standard errors. The rate is that at the start of a parabola through three blocks of rows, whose length
    depends on the noise, up to `window` [s]. The rate from the first to the second block must be within the
    range `alike` of this rate, relative to it; otherwise the command stands at first and moves later.

    The motion before the recording is simulated over `lead` [s] of the command, extended backwards by a
    parabola through the first `window`, and by two lines: with the rate of the first row, and with the
    opposite rate, because the command may just have reversed. If it does not move in the first row, the lines
    have the shares `stopped` of its rms rate. If it moves, the recording counts as starting at rest only if
    models from rest have less than `rest` times the rms residual of models with any motion before; if it does
    not move, models with a motion must have less than `rest` times the residual of models from rest.
    Residuals are evaluated over the first `shows` [s]: later rows contain less of the start and more of the
    other faults. Of 200 recordings from rest with random faults (base setting), 11 seemed to move according
    to the first 20 ms, none according to the first 5 ms.

    Rows are left out while the models differ, up to `most` of all rows. The models are compared over at most
    `longest` [s], or over `FIRST_MOTION.longest` if the command does not move. A slow actuator has neither
    followed the motion before within `lead` nor forgotten it after `longest`. If the command moves, no
    position is recorded, and the models still differ at the end, both times are therefore doubled until the
    models no longer differ, up to `most_slow` of all rows. A recorded position confines the models before.
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
    most_slow: float = 0.75
    longest: float = 1.0


MOVING_START = MovingStartSettings()


def command_moves(problem: Problem) -> bool:
    """Return whether the command already moves in the first row.

    A command that stands for a row and then moves does not, nor does one that begins quadratically.
    """
    return first_rate(problem) != 0.0


def first_rate(problem: Problem) -> float:
    """Return the rate of the command [rad/s] from the first row on, 0 if it does not move there."""
    command, interval = problem.measured["command_rad"], problem.inputs.interval
    jumps = _jumps_of(problem)
    if _jump_at_once(jumps):
        return 0.0
    least = MOVING_START.moving * _usual_rate(problem, jumps)
    noise = max(noise_on_most_rows(command), visible_count(command) / ROUNDING)
    most = max(1, min(round(MOVING_START.window / interval), command.size) // 3)
    for rows in range(1, most + 1):
        # Each block is a mean over its rows; the rate at the start is (-3, 4, -1) / 2 times the blocks.
        error = MOVING_START.significant * noise * (26 / rows) ** 0.5 / (2 * rows * interval)
        if error <= least or rows == most:
            break
    first, second, third = command[: 3 * rows].reshape(3, rows).mean(axis=1)
    rate_at_start = (4 * second - third - 3 * first) / (2 * rows * interval)
    rate = (second - first) / (rows * interval)
    if abs(rate_at_start) <= max(least, error):
        return 0.0
    low, high = MOVING_START.alike
    return float(rate) if low <= rate / rate_at_start <= high else 0.0


def _jump_at_once(jumps: Jumps) -> bool:
    """Return whether the command jumps in the first row: the recording then shows the start of the motion."""
    return bool(np.any(jumps.before == 0))


def _jumps_of(problem: Problem) -> Jumps:
    """Return the jumps of the command."""
    return Jumps.of(problem.measured["command_rad"], means=problem.driving.sampling == "mean")


def _usual_rate(problem: Problem, jumps: Jumps) -> float:
    """Return the rms rate [rad/s] of the command outside its jumps."""
    return rms(jumps.changes_between(problem.measured["command_rad"]) / problem.inputs.interval)


def first_motion(problem: Problem) -> tuple[float, float]:
    """Return the rate [rad/s] and the acceleration [rad/s²] of the command at the start."""
    window = max(MOVING_START.window, 3 * problem.inputs.interval)
    times = np.linspace(0.0, window, 21)
    values = problem.driving.command(times)
    terms = np.stack([times, times**2 / 2], axis=1)
    (rate, acceleration), *_ = np.linalg.lstsq(terms, values - values[0], rcond=None)
    return float(rate), float(acceleration)


def rows_of_moving_start(problem: Problem, *, moves: bool) -> tuple[int, float]:
    """Return the number of first rows that depend on the motion before, and the motor's side of the gap.

    The number is 0 if the recording starts from rest. This applies to recordings that do not show their start
    (`emaphm.estimation.rows.initial_state.shows_start`). `moves` states whether the command moves there
    (`command_moves`): if so, models from rest must fit better by the factor `MOVING_START.rest` to be
    accepted; otherwise models in motion must.
    """
    faults = likely_faults(problem)
    if not moves and (_jump_at_once(_jumps_of(problem)) or _rest_leaves_noise(problem, faults)):
        return 0, 0.0
    motions = motions_before(problem)
    if not any(rate for rate, _ in motions):
        return 0, 0.0
    longest = MOVING_START.longest if moves else FIRST_MOTION.longest
    rows = min(problem.samples, max(1, math.ceil(longest / problem.inputs.interval)))
    lead = math.ceil(MOVING_START.lead / problem.inputs.interval)
    at_rest, moving, count = _compared_starts(problem, motions, lead, rows, faults)
    most, slow = (int(x * problem.samples) for x in (MOVING_START.most, MOVING_START.most_slow))
    open_start = moves and "position_rad" not in problem.measured
    while open_start and rows < slow and (rows - count) * problem.inputs.interval < FORGOTTEN_S:
        lead, rows, most = rows, min(slow, 2 * rows), slow
        at_rest, moving, count = _compared_starts(problem, motions, lead, rows, faults)
    if not count:
        return 0, 0.0
    shown = min(count, _shown_rows(problem))
    moving_residuals = [least_residual(problem, outputs, 0, shown) for outputs in moving]
    rest_residual = min(least_residual(problem, outputs, 0, shown) for outputs in at_rest)
    share = MOVING_START.rest if moves else 1 / MOVING_START.rest
    if rest_residual <= share * min(moving_residuals):
        return 0, 0.0
    side = side_of(motions[int(np.argmin(moving_residuals))][0])
    return min(count, most), side


def _compared_starts(
    problem: Problem, motions: list[tuple[float, float]], lead: int, rows: int, faults: Array
) -> tuple[list[Array], list[Array], int]:
    """Return the models over `rows` from rest and after `lead` rows of each motion, and how many rows differ.

    Each element has the shape (n, channels, rows).
    """
    at_rest = _from_rest(problem, rows, faults)
    moving = [_after_motion(problem, motion, lead, rows, faults) for motion in motions]
    return at_rest, moving, rows_apart(problem, [*at_rest, *moving])


def _shown_rows(problem: Problem) -> int:
    """Return the number of first rows that contain the start, including the delay of the sensors."""
    seconds = MOVING_START.shows + longest_delay(problem)
    return min(problem.samples, max(1, math.ceil(seconds / problem.inputs.interval)))


def _rest_leaves_noise(problem: Problem, faults: Array) -> bool:
    """Return whether models from rest are so near to noise that models in motion cannot fit better."""
    rows = _shown_rows(problem)
    residual = min(least_residual(problem, outputs, 0, rows) for outputs in _from_rest(problem, rows, faults))
    return residual <= noise_residual(problem) / MOVING_START.rest


def _from_rest(problem: Problem, rows: int, faults: Array) -> list[Array]:
    """Return the channels (n, channels, rows) of models at rest at the recorded position and on the command.

    A deviation of the recorded position from the command may be the zero error of its sensor.
    """
    driving = problem.driving.beginning(0.0, rows)
    on_command = float(driving.command(np.zeros(1))[0]) / problem.actuator.mechanics.gear_ratio
    return [first_rows(problem, driving, angle, faults) for angle in {problem.start.angle, on_command}]


def residual_after_motion(problem: Problem, rows: int) -> float:
    """Return the least rms residual over the first `rows` of models with a motion before the recording."""
    faults = likely_faults(problem)
    lead = math.ceil(MOVING_START.lead / problem.inputs.interval)
    return min(
        least_residual(problem, _after_motion(problem, motion, lead, rows, faults), 0, rows)
        for motion in motions_before(problem)
    )


def motions_before(problem: Problem) -> list[tuple[float, float]]:
    """Return possible rates [rad/s] and accelerations [rad/s²] of the command before the recording."""
    rate = first_rate(problem)
    rates = [rate]
    if not rate:
        usual = _usual_rate(problem, _jumps_of(problem))
        rates = [share * usual for share in MOVING_START.stopped]
    return [first_motion(problem), *((sign * size, 0.0) for size in rates for sign in (1.0, -1.0))]


def _after_motion(
    problem: Problem, motion: tuple[float, float], lead: int, rows: int, faults: Array
) -> Array:
    """Return the channels (n, channels, rows) of models after `lead` rows of a `motion` of the command."""
    driving, angle = _with_motion_before(problem, motion, lead, rows)
    return first_rows(problem, driving, angle, faults)[:, :, lead:]


def _with_motion_before(
    problem: Problem, motion: tuple[float, float], lead: int, rows: int
) -> tuple[DrivingSignals, float]:
    """Return the signals with `lead` rows of a `motion` before `rows`, and the motor's first angle [rad]."""
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
