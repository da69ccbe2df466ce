"""Rows at the start of a recording that depend on a motion before it, which nothing recorded shows."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from emaphm.estimation.rows.held_start import rows_of_held_start
from emaphm.estimation.rows.moving_start import command_moves, rows_of_moving_start
from emaphm.recording.sensor_checks.resolution import Mask

if TYPE_CHECKING:
    from emaphm.estimation.problem import Problem


@dataclass(frozen=True)
class UnknownStart:
    """The first `rows` of a recording, `seconds` long, which are not compared.

    The shaft may be `held` off the command by friction there, else it is in motion from the first row on.
    """

    rows: int = 0
    seconds: float = 0.0
    held: bool = False

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
                else "too little motion follows to do without the rest, so take what is estimated of load, "
                "friction and zeros with caution, or begin before that motion"
            )
            return (f"{NOT_THE_MODELS}: {left_out}",)
        if not self.rows:
            return ()
        note = (
            "the command moves already in the first row, and how the shaft moves there is not known: the "
            f"first {1e3 * self.seconds:.3g} ms depend on the motion before and are not compared. They are "
            "if the recording starts at rest, or has position_rad and speed_rad_s"
        )
        return (note,)


NOT_THE_MODELS = (
    "the recording begins at a rest with a current that is not the model's, by a load that was not recorded, "
    "by the sensor's zero, or by friction that holds the shaft off the command since a motion before"
)

FROM_REST = UnknownStart()


def unknown_start(problem: "Problem", *, shown: bool) -> UnknownStart:
    """Return what of the start is not known; where the command moves, it is if the recording has `shown` it.

    As `emaphm.estimation.initial_state.shows_start` says.
    """
    if command_moves(problem):
        rows = 0 if shown else rows_of_moving_start(problem)
        if rows or shown:
            return UnknownStart(rows, rows * problem.inputs.interval)
    held = rows_of_held_start(problem)
    return FROM_REST if held is None else UnknownStart(held, held * problem.inputs.interval, held=True)
