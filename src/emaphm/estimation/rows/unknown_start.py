"""Rows at the start of a recording that depend on a motion before it, which nothing recorded shows."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

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
from emaphm.recording.sensor_checks.resolution import Mask

if TYPE_CHECKING:
    from emaphm.estimation.problem import Problem


Start: TypeAlias = Literal["held", "current", "motion", "step", "seen", "side"]
"""What is not known of a start."""


@dataclass(frozen=True)
class UnknownStart:
    """The first `rows` of a recording, `seconds` long, which are not compared, and what is not known there.

    Friction `held` the shaft off the command, or that or a motion makes its `current`; the command was in
    `motion`, the shaft follows a `step` from before or is in a motion that is not `seen`, or the motor may be
    at either `side` of the backlash. Models start at the share `gap` of half of the backlash, where the last
    motion has led the motor.
    """

    rows: int = 0
    seconds: float = 0.0
    what: Start = "motion"
    gap: float = 0.0

    @property
    def held(self) -> bool:
        """Whether friction may hold the shaft off the command."""
        return self.what in ("held", "current")

    def masks(self, problem: "Problem") -> dict[str, Mask]:
        """Return by compared channel of the `problem` which rows are not compared, (samples,)."""
        mask = np.arange(problem.samples) < self.rows
        return dict.fromkeys(problem.channels, mask) if self.rows else {}

    def notes(self) -> tuple[str, ...]:
        """Return a note where rows are not compared, or would better not be."""
        if self.held:
            left_out = (
                f"the first {self.seconds:.3g} s are not compared"
                if self.rows
                else "too little motion follows to do without the first rows, so take what is estimated of "
                "load, friction and zeros with caution, or begin before that motion"
            )
            return (f"{NOTES[self.what]}: {left_out}",)
        if not self.rows:
            return ()
        return (NOTES[self.what].format(f"the first {1e3 * self.seconds:.3g} ms"),)


NOTES: dict[Start, str] = {
    "held": "the recording begins at a rest with a current that is not the model's, by a load that was not "
    "recorded, by the sensor's zero, or by friction that holds the shaft off the command since a motion "
    "before",
    "current": "the current in the first rows is not the model's, by a load that was not recorded, by the "
    "sensor's zero, by a motion before, or by friction that holds the shaft off the command since then",
    "motion": "the command moves already in the first row, and how the shaft moves there is not known: {} "
    "depend on the motion before and are not compared. They are if the recording starts at rest, or has "
    "position_rad and speed_rad_s",
    "seen": "how the shaft moves in the first row is not known: {} depend on the motion before and are not "
    "compared. They are if the recording starts at rest, or has position_rad and speed_rad_s",
    "step": "in the first row the shaft is on its way to a command that stands, and how fast is not known: "
    "{} depend on it and are not compared. They are if the recording starts at rest, or has speed_rad_s",
    "side": "at which side of the backlash the motor stands in the first row is not known: {} depend on it "
    "and are not compared",
}

FROM_REST = UnknownStart()


def unknown_start(problem: "Problem", *, shown: bool) -> UnknownStart:
    """Return what of the start is not known; where the command moves, it is if the recording has `shown` it.

    As `emaphm.estimation.initial_state.shows_start` says.
    """
    interval, moves = problem.inputs.interval, command_moves(problem)
    if moves and not shown:
        rows, side = rows_of_moving_start(problem)
        if rows:
            return UnknownStart(rows, rows * interval, "motion", side)
    # Where the command stands friction stops the shaft, by chance: that it moves at first shows too little.
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
        rows, side = rows_of_moving_start(problem)
        if rows:
            return UnknownStart(rows, rows * interval, "seen", side)
    return UnknownStart(gap=side_of(problem.start.speed))


def _shown_motion(problem: "Problem") -> UnknownStart:
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
