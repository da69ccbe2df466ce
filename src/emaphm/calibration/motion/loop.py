"""Choice between calibration in closed loop and by measured motion, with its reason."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from emaphm.actuator import Actuator
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.motion.fit import OF_CONTROLLER
from emaphm.errors import EmaphmError, MethodError, nearest
from emaphm.estimation.inverse_dynamics import ControllerCheck, controller_check
from emaphm.estimation.uncertainty.collinearity import listed

Loop: TypeAlias = Literal["auto", "closed", "measured"]
"""Closed loop: the command is the input, all other channels are compared. Measured motion: position and speed
are the inputs, the current, voltage or duty is compared. "auto": closed loop unless a recording contradicts
the gains."""

LOOPS = ("auto", "closed", "measured")

WORDS = {"closed": "in closed loop", "measured": "by measured motion"}


@dataclass(frozen=True)
class LoopChoice:
    """Loop that was used, "closed" or "measured", and the reason in words."""

    loop: str
    reason: str

    def __str__(self) -> str:
        """Return the choice as a sentence."""
        return f"Calibrated {WORDS[self.loop]}: {self.reason}"


CLOSED = LoopChoice("closed", "as asked for")


def chosen_loop(
    loop: Loop, rows: Sequence[CampaignRow], actuator: Actuator, free: Sequence[str]
) -> LoopChoice:
    """Return the loop that the user requested, or the loop that a check of the controller suggests.

    Raises
    ------
    MethodError
        The loop is unknown.
    """
    if loop not in LOOPS:
        raise MethodError(f"unknown loop '{loop}'{nearest(loop, LOOPS)}")
    if loop != "auto":
        return LoopChoice(loop, "as asked for")
    checks = [(row.recording.source, check) for row in rows if (check := _check(row, actuator)) is not None]
    if not checks:
        return LoopChoice("closed", "the controller's gains are not identifiable from the recordings")
    against = [
        f"{'; '.join(check.deviating)} in {source}" for source, check in checks if check.gains_contradict
    ]
    if not against:
        unclear = [source for source, check in checks if check.contradicts]
        if unclear:
            return LoopChoice(
                "closed", f"the controller's gains are not clearly identifiable from {listed(unclear, 'and')}"
            )
        return LoopChoice("closed", "the described controller agrees with the recordings")
    contradiction = f"the described controller contradicts the recordings: {', '.join(against)}"
    gains = sorted({*free, *(name for row in rows for name in row.free)} & set(OF_CONTROLLER))
    if gains:
        return LoopChoice(
            "closed", f"{contradiction}; closed loop nevertheless, because '{gains[0]}' is free"
        )
    return LoopChoice("measured", contradiction)


def _check(row: CampaignRow, actuator: Actuator) -> ControllerCheck | None:
    """Return the check of a recording's controller; None if it cannot be checked."""
    try:
        return controller_check(row.completed(), row.described(actuator))
    except EmaphmError:
        return None
