"""Unknown start of a recording: a motion before it, or a position at which friction holds the shaft."""

import math
from dataclasses import replace

from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.begun_step import rows_of_begun_step
from emaphm.estimation.rows.gap_side import (
    has_crossed_gap,
    leaves_enough,
    motion_after,
    rows_of_unknown_side,
    side_of,
)
from emaphm.estimation.rows.held_start import command_stands, current_not_drawn, held_start
from emaphm.estimation.rows.moving_start import command_moves, first_motion, rows_of_moving_start
from emaphm.estimation.rows.unknown_start import FROM_REST, Start, UnknownStart

LAGS = 5.0
"""Time until a lag has followed the motion before the start, in its time constants: to 1 %."""


def unknown_start(problem: Problem, *, shown: bool) -> UnknownStart:
    """Return the unknown part of the start.

    `shown` states whether the recording determines position and speed at its start
    (`emaphm.estimation.rows.initial_state.shows_start`); with a moving command, the start is then known.
    """
    unknown = _unknown_motion(problem, shown=shown)
    rows = _rows_of_late_sensors(problem)
    if unknown.held or rows <= unknown.rows:
        return unknown
    return replace(unknown, rows=rows, seconds=rows * problem.inputs.interval, what="sensor")


def _rows_of_late_sensors(problem: Problem) -> int:
    """Return the number of first rows in which described sensors show the motion before a start in motion."""
    if not problem.start.speed:
        return 0
    sensors = [problem.actuator.sensors.of(name) for name in problem.channels]
    seconds = max(sensor.delay + LAGS * sensor.lag for sensor in sensors)
    return min(math.ceil(seconds / problem.inputs.interval), problem.samples // 2)


def _unknown_motion(problem: Problem, *, shown: bool) -> UnknownStart:
    """Return the unknown part of the start without that of late sensors."""
    interval, moves = problem.inputs.interval, command_moves(problem)
    if moves and not shown:
        rows, side = rows_of_moving_start(problem, moves=moves)
        if rows:
            return UnknownStart(rows, rows * interval, "motion", side)
    # With a constant command, friction stops the shaft at a random position: an initial speed is not enough.
    stands = command_stands(problem)
    known = shown and (moves or (problem.start.speed != 0.0 and not stands))
    held = None if known else held_start(problem)
    if held is not None:
        what: Start = "held" if held.stands else "current"
        return UnknownStart(held.rows, held.rows * interval, what, side_of(held.current))
    rows = 0 if shown and moves else rows_of_begun_step(problem)
    if known and not rows:
        return _shown_motion(problem)
    if rows:
        what = "step" if stands else "seen"
        return UnknownStart(rows, rows * interval, what, side_of(problem.start.speed))
    if not moves:
        rows, side = rows_of_moving_start(problem, moves=moves)
        if rows:
            return UnknownStart(rows, rows * interval, "seen", side)
    return UnknownStart(gap=side_of(problem.start.speed))


def _shown_motion(problem: Problem) -> UnknownStart:
    """Return the unknown part of a start whose motion of the user is known: the motor's side of the gap.

    After a reversal the motor crosses the gap while the user stands.
    """
    gap = side_of(problem.start.speed)
    if gap and has_crossed_gap(problem, first_motion(problem)[1]):
        return UnknownStart(gap=gap)
    current, _ = current_not_drawn(problem)
    if not gap and not current:
        return FROM_REST
    rows = rows_of_unknown_side(problem, motion_after(problem))
    rows = rows if leaves_enough(problem, rows) else 0
    return UnknownStart(rows, rows * problem.inputs.interval, "side", gap or side_of(current))
