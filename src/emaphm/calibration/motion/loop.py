"""Whether a unit is calibrated in closed loop or by its measured motion, and why."""

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
"""Closed loop: the command goes in, all else is compared. Measured motion: position and speed go in, the
current, voltage or duty is compared. Automatic: closed loop unless a recording contradicts the gains."""

LOOPS = ("auto", "closed", "measured")

WORDS = {"closed": "in closed loop", "measured": "by measured motion"}


@dataclass(frozen=True)
class LoopChoice:
    """The loop that was used, "closed" or "measured", and the reason in words."""

    loop: str
    reason: str

    def __str__(self) -> str:
        """Return the choice as a sentence."""
        return f"Calibrated {WORDS[self.loop]}: {self.reason}"


CLOSED = LoopChoice("closed", "as asked for")


def chosen_loop(
    loop: Loop, rows: Sequence[CampaignRow], actuator: Actuator, free: Sequence[str]
) -> LoopChoice:
    """Return what the user asked for, or what the controller's part in the recordings asks for.

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
        return LoopChoice("closed", "no recording shows the controller's gains")
    against = [
        f"{'; '.join(check.deviating)} in {source}" for source, check in checks if check.gains_contradict
    ]
    if not against:
        unclear = [source for source, check in checks if check.contradicts]
        if unclear:
            return LoopChoice(
                "closed", f"the controller's gains do not show clearly in {listed(unclear, 'and')}"
            )
        return LoopChoice("closed", "the described controller agrees with what was recorded")
    found = f"the described controller contradicts what was recorded: {', '.join(against)}"
    gains = sorted({*free, *(name for row in rows for name in row.free)} & set(OF_CONTROLLER))
    if gains:
        return LoopChoice("closed", f"{found}; closed loop all the same, as '{gains[0]}' is free")
    return LoopChoice("measured", found)


def _check(row: CampaignRow, actuator: Actuator) -> ControllerCheck | None:
    """Return the check of a recording's controller, None where it cannot be checked."""
    try:
        return controller_check(row.completed(), row.described(actuator))
    except EmaphmError:
        return None
