"""Rows at the start of a recording that depend on a motion before it, which nothing recorded shows."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from emaphm.recording.sensor_checks.resolution import Mask

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

    def masks(self, samples: int, channels: tuple[str, ...]) -> dict[str, Mask]:
        """Return by channel which of its rows are not compared, (samples,); none where all are."""
        mask = np.arange(samples) < self.rows
        return dict.fromkeys(channels, mask) if self.rows else {}

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
    "depend on the motion before and are not compared. They are if the recording starts at rest, or if "
    "position_rad and speed_rad_s show its speed there to 1 %",
    "seen": "how the shaft moves in the first row is not known: {} depend on the motion before and are not "
    "compared. They are if the recording starts at rest, or if position_rad and speed_rad_s show its speed "
    "there to 1 %",
    "step": "in the first row the shaft is on its way to a command that stands, and how fast is not known: "
    "{} depend on it and are not compared. They are if the recording starts at rest, or has speed_rad_s",
    "side": "at which side of the backlash the motor stands in the first row is not known: {} depend on it "
    "and are not compared",
}

FROM_REST = UnknownStart()
