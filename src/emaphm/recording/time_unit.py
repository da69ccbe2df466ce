"""Another unit of time taken for seconds, distinguished from slow and fast rows by the motion's torque."""

import math

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array, rms
from emaphm.recording.recording import Recording

SLOW_S = 0.02
"""Rows this far apart may be milliseconds taken for seconds: of 50 kHz, the fastest of loggers [s]."""

APPARENT_INERTIA = 1e4
"""Ratio of the inertia that the current shows to the described one from which the times are wrong. It goes by
the square of the unit of time: milliseconds make it 10⁶ (3 10⁵ to 1.2 10⁶ of chirps at 20 kHz under random
faults), while a load that changes with the motion makes 2 10³ of slow rows."""

SIGNIFICANT = 10.0
"""Standard errors by which that inertia must differ from 0: the rows of a slow motion show none at all."""

SPEED_RATIO = 20.0
"""Ratio of a recorded speed to that of the recorded motion from which the times are wrong; backlash and
resonance make less."""

SAME_MOTION = 0.5
"""Least correlation of the recorded speed with that of the motion."""

FAST_S = 2e-5
"""Rows no farther apart may be seconds taken for milliseconds: of 50 Hz and faster [s]."""

IMPOSSIBLE_WORK = 300.0
"""Ratio of the kinetic energy of a motion to the most work of the motor over its travel from which the times
are wrong. It is 1 at most of a motor alone, and 10⁻³ or more of a motion that shows its inertia; it goes by
the square of the unit of time: seconds taken for milliseconds make it 10⁶ times as large."""

STRETCHES = 64
"""Parts of a recording whose mean positions show its motion: noise of single rows is no motion."""


def time_unit_complaint(recording: Recording, actuator: Actuator) -> str | None:
    """Return why rows seem to be in another unit of time than seconds, None where nothing says so."""
    if recording.interval_s <= FAST_S:
        return _impossible_work(recording, actuator)
    if recording.interval_s <= SLOW_S:
        return None
    reason = _speed(recording, actuator) or _inertia(recording, actuator)
    if not reason:
        return None
    return (
        f"rows are {recording.interval_s:.4g} s apart, and {reason}: time_s seems to be in milliseconds, "
        "convert it to s"
    )


def _speed(recording: Recording, actuator: Actuator) -> str | None:
    """Compare a recorded speed with that of the recorded position, or of the command."""
    if "speed_rad_s" not in recording:
        return None
    speed = np.diff(_motor_angle(recording, actuator)) / recording.interval_s
    measured = recording["speed_rad_s"][1:]
    of_motion, of_sensor = rms(speed), rms(measured)
    if not 0 < SPEED_RATIO * of_motion < of_sensor:
        return None
    # At rest both are noise, of any ratio.
    if float(np.mean(speed * measured)) < SAME_MOTION * of_motion * of_sensor:
        return None
    return f"the motor's speed is {of_sensor / of_motion:.3g} times that of its motion"


def _inertia(recording: Recording, actuator: Actuator) -> str | None:
    """Compare the inertia that the current shows with the described one.

    From least squares k_t i = J α + C ω + F sgn ω + K θ + T_0 over the rows, with ω and α from differences of
    the angle θ. A motion too slow for its inertia to show gives J with a large error, and no complaint.
    """
    if "current_A" not in recording:
        return None
    angle, interval = _motor_angle(recording, actuator), recording.interval_s
    speed = (angle[2:] - angle[:-2]) / (2 * interval)
    acceleration = np.diff(angle, 2) / interval**2
    torque = actuator.motor.torque_constant * recording["current_A"][1:-1]
    regressors = np.stack([acceleration, speed, np.sign(speed), angle[1:-1], np.ones_like(speed)])
    sizes = np.sqrt(np.mean(regressors**2, axis=1))
    if not np.all(sizes > 0):
        return None
    regressors /= sizes[:, np.newaxis]
    normal = regressors @ regressors.T
    inverse = np.linalg.pinv(normal, rcond=1e-9, hermitian=True)
    values = inverse @ (regressors @ torque)
    residual = torque - values @ regressors
    error = math.sqrt(float(inverse[0, 0]) * float(np.mean(residual**2)))
    inertia = float(values[0] / sizes[0])
    ratio = inertia / actuator.mechanics.inertia
    if ratio < APPARENT_INERTIA or values[0] < SIGNIFICANT * error:
        return None
    return f"the current would accelerate {ratio:.2g} times the described inertia"


def _impossible_work(recording: Recording, actuator: Actuator) -> str | None:
    """Compare the energy J ω² / 2 of the recorded motion with the work k_t i_max Δθ of the motor.

    ω is the rms speed between means of the angle over stretches of rows, Δθ the travel of these means.
    """
    if "position_rad" not in recording or recording.samples < STRETCHES:
        return None
    # A command may jump; what has mass does not.
    parts = np.array_split(_motor_angle(recording, actuator), STRETCHES)
    angle = np.array([float(np.mean(part)) for part in parts])
    speed = rms(np.diff(angle)) * STRETCHES / recording.duration_s
    energy = actuator.mechanics.inertia * speed**2 / 2
    work = actuator.motor.torque_constant * actuator.controller.current_limit * float(np.ptp(angle))
    if energy < IMPOSSIBLE_WORK * work or not energy:
        return None
    unit = actuator.channels.time_s.unit
    remedy = "convert it to s" if unit is None else f"[channels] says '{unit}', correct it there"
    return (
        f"rows are {recording.interval_s:.4g} s apart, and the motion would take {energy / work:.2g} times "
        f"the work that the motor can do: time_s seems to be in a larger unit than was taken; {remedy}"
    )


def _motor_angle(recording: Recording, actuator: Actuator) -> Array:
    name = "position_rad" if "position_rad" in recording else "command_rad"
    return np.asarray(recording[name] / actuator.mechanics.gear_ratio)
