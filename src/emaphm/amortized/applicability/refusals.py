"""Actuators and recordings that an estimator cannot evaluate, and the remedies.

Recordings are refused only if a search from the estimator's answer is impossible too. Properties that no
estimator is trained for are checked first, so that no message advises another training in vain.
"""

import numpy as np

from emaphm.actuator import Actuator
from emaphm.amortized.recording_setup import (
    COMMAND_TOLERANCE,
    MOST_ROWS,
    RATE_TOLERANCE,
    RecordingSetup,
    actuator_hash,
)
from emaphm.errors import MethodError
from emaphm.recording import Recording

LEAVE_OUT = "leave out --estimator"

OR_TRAIN = f"{LEAVE_OUT}, or train one for it with 'emaphm train'"


def check_trained_for(setup: RecordingSetup, actuator: Actuator) -> None:
    """Raise `MethodError` if `actuator` is not the description that an estimator was trained for."""
    if not actuator.three_phases:
        raise MethodError(
            f"actuator '{actuator.name}' has a drive of kind '{actuator.drive_kind}', which no estimator is "
            f"trained for; {LEAVE_OUT}"
        )
    own, other = actuator_hash(setup.actuator), actuator_hash(actuator)
    if own != other:
        raise MethodError(
            f"the estimator was trained for another description of an actuator ('{setup.actuator.name}', "
            f"{own}; this is '{actuator.name}', {other}); {OR_TRAIN}"
        )


def check_recording(setup: RecordingSetup, recording: Recording) -> None:
    """Raise `MethodError` for a recording that an estimator cannot evaluate.

    It is of another manoeuvre, rate or duration, lacks a channel, or has what no estimator is trained for.
    """
    untrainable = _untrainable_property(recording)
    if untrainable is not None:
        raise MethodError(f"{recording.source} {untrainable}; {LEAVE_OUT}")
    difference = _difference_from_training(setup, recording)
    if difference is not None:
        raise MethodError(f"{recording.source} {difference}; {OR_TRAIN}")


def _untrainable_property(recording: Recording) -> str | None:
    """Return a property of the recording for which no estimator can be trained; None if it has none."""
    if "current_A" not in recording:
        return "has no current_A, without which no estimator is trained"
    if recording.samples > MOST_ROWS:
        return f"has {recording.samples:,} rows, an estimator is trained on {MOST_ROWS:,} at most"
    if "enabled" in recording and not np.all(recording["enabled"] == 1):
        return "has a drive that is switched off, which no estimator is trained on"
    if "load_Nm" in recording and np.any(recording["load_Nm"]):
        return (
            "has a known load, which a search takes into account; an estimator is trained on an unknown "
            "constant one"
        )
    return None


def _difference_from_training(setup: RecordingSetup, recording: Recording) -> str | None:
    """Return a difference of the recording from the setup, which another training would remove; or None."""
    missing = [name for name in setup.channels if name not in recording]
    if missing:
        return f"has no {', '.join(missing)}, which the estimator was trained on"
    if recording.sampling != setup.sampling:
        return f"has rows that are {recording.sampling}s, the estimator's are {setup.sampling}s"
    if abs(recording.interval_s / setup.interval_s - 1) > RATE_TOLERANCE:
        return (
            f"has {1 / recording.interval_s:.6g} rows a second, the estimator was trained on "
            f"{1 / setup.interval_s:.6g}"
        )
    if recording.samples != setup.samples:
        return f"has {recording.samples} rows, the estimator's manoeuvre {setup.samples}"
    difference = float(np.max(np.abs(recording["command_rad"] - setup.command_rad)))
    if difference > COMMAND_TOLERANCE * setup.reach:
        return (
            f"is of another manoeuvre: its command differs by up to {100 * difference / setup.reach:.3g} % "
            "from the one that the estimator was trained on"
        )
    return None
