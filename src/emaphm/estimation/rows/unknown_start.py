"""Rows at the start of a recording that depend on an unrecorded motion before it."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from emaphm.recording.sensor_checks.resolution import Mask

Start: TypeAlias = Literal["held", "current", "motion", "step", "seen", "side", "sensor"]
"""The unknown of a start."""


@dataclass(frozen=True)
class UnknownStart:
    """The first `rows` of a recording, `seconds` long, which are not compared, and the unknown of its start.

    `what` is "held" if friction holds the shaft at a distance from the command; "current" if friction or a
    motion causes the initial current; "motion" if the command moved before; "step" if the shaft follows a
    step before the recording; "seen" if it is in a motion that was not recorded; "side" if the motor may be
    at either side of the backlash; "sensor" if late sensors show the motion before the first row. Models
    start at `gap`, relative to half the backlash, to which the last motion has led the motor.
    """

    rows: int = 0
    seconds: float = 0.0
    what: Start = "motion"
    gap: float = 0.0

    @property
    def held(self) -> bool:
        """Whether friction may hold the shaft at a distance from the command."""
        return self.what in ("held", "current")

    def masks(self, samples: int, channels: tuple[str, ...]) -> dict[str, Mask]:
        """Return by channel the rows (samples,) that are not compared; empty if all rows are compared."""
        mask = np.arange(samples) < self.rows
        return dict.fromkeys(channels, mask) if self.rows else {}

    def notes(self) -> tuple[str, ...]:
        """Return a note if rows are not compared, or if they should not be compared."""
        if self.held:
            left_out = (
                f"the first {self.seconds:.3g} s are not compared"
                if self.rows
                else "too little motion follows to leave out the first rows; use the estimates of load, "
                "friction and zeros with caution, or begin the recording before that motion"
            )
            return (f"{NOTES[self.what]}: {left_out}",)
        if not self.rows:
            return ()
        left_out = f"{1e3 * self.seconds:.3g} ms" if self.seconds < 1 else f"{self.seconds:.3g} s"
        return (NOTES[self.what].format(f"the first {left_out}"),)


NOTES: dict[Start, str] = {
    "held": "the recording begins at a rest with a current that differs from the model's; possible causes "
    "are an unrecorded load, the sensor's zero, or friction that holds the shaft at a distance from the "
    "command after an earlier motion",
    "current": "the current in the first rows differs from the model's; possible causes are an unrecorded "
    "load, the sensor's zero, an earlier motion, or friction that holds the shaft at a distance from the "
    "command after it",
    "motion": "the command already moves in the first row, and the shaft's motion there is unknown: {} "
    "depend on the motion before and are not compared. They are compared if the recording starts at rest, or "
    "if position_rad and speed_rad_s show the speed there to 1 %",
    "seen": "the shaft's motion in the first row is unknown: {} depend on the motion before and are not "
    "compared. They are compared if the recording starts at rest, or if position_rad and speed_rad_s show "
    "the speed there to 1 %",
    "step": "in the first row the shaft is on its way to a constant command, with an unknown speed: {} "
    "depend on it and are not compared. They are compared if the recording starts at rest, or contains "
    "speed_rad_s",
    "side": "the side of the backlash at which the motor stands in the first row is unknown: {} depend on "
    "it and are not compared",
    "sensor": "the recording begins within a motion, and sensors with a described delay or lag first show "
    "the motion before it: {} are not compared",
}

FROM_REST = UnknownStart()
