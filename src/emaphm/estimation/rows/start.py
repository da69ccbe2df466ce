"""What of the start of a recording is not known: a motion before it, or where friction holds the shaft."""

from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.begun_step import rows_of_begun_step
from emaphm.estimation.rows.gap_side import (
    has_crossed_gap,
    leaves_enough,
    motion_after,
    rows_of_unknown_side,
    side_of,
)
from emaphm.estimation.rows.held_start import current_not_drawn, held_start
from emaphm.estimation.rows.moving_start import command_moves, first_motion, rows_of_moving_start
from emaphm.estimation.rows.unknown_start import FROM_REST, UnknownStart


def unknown_start(problem: Problem, *, shown: bool) -> UnknownStart:
    """Return what of the start is not known; where the command moves, it is if the recording has `shown` it.

    As `emaphm.estimation.initial_state.shows_start` says.
    """
    interval, moves = problem.inputs.interval, command_moves(problem)
    if moves and not shown:
        rows = rows_of_moving_start(problem)
        if rows:
            return UnknownStart(rows, rows * interval, gap=side_of(first_motion(problem)[0]))
    if moves and shown:
        return _shown_motion(problem)
    held = held_start(problem)
    if held is not None:
        return UnknownStart(held.rows, held.rows * interval, "held", side_of(held.current))
    rows = rows_of_begun_step(problem)
    return UnknownStart(rows, rows * interval, "step", side_of(problem.start.speed))


def _shown_motion(problem: Problem) -> UnknownStart:
    """Return what is not known where the recording shows how the user moves: the motor's side of the gap.

    After a turn it crosses the gap, and the user stands.
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
