"""Check of the unit of time: a wrong unit is distinguished from slow or fast rows by the motion's torque."""

import math

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array, rms
from emaphm.recording.recording import Recording

SLOW_S = 0.02
"""Interval between rows [s] above which they may be milliseconds taken for seconds, of the fastest loggers
with 50 kHz."""

APPARENT_INERTIA = 1e4
"""Ratio of the inertia estimated from the current to the described inertia from which the times are wrong. It
scales with the square of the unit of time: milliseconds give 10⁶ (3 10⁵ to 1.2 10⁶ for chirps at 20 kHz with
random faults), while a load that changes with the motion gives 2 10³ with slow rows."""

SIGNIFICANT = 10.0
"""Least ratio of that inertia to its standard error: it is not identifiable from the rows of a slow
motion."""

SPEED_RATIO = 20.0
"""Ratio of the recorded speed to the derivative of the recorded position from which the times are wrong;
backlash and resonance give smaller ratios."""

SAME_MOTION = 0.5
"""Least correlation of the recorded speed with the derivative of the recorded position."""

FAST_S = 2e-5
"""Interval between rows [s] up to which they may be seconds taken for milliseconds, of rows at 50 Hz and
faster."""

IMPOSSIBLE_WORK = 300.0
"""Ratio of the kinetic energy of a motion to the largest work of the motor over its travel from which the
times are wrong. It is at most 1 for a motor without external torque, and at least 10⁻³ for a motion that is
affected by its inertia. It scales with the square of the unit of time: seconds taken for milliseconds
increase it by 10⁶."""

STRETCHES = 64
"""Number of parts of a recording whose mean positions represent its motion, without the noise of single
rows."""


def time_unit_complaint(recording: Recording, actuator: Actuator) -> str | None:
    """Return the reason why the times seem not to be in seconds, None if there is no reason."""
    if recording.interval_s <= FAST_S:
        return _work_complaint(recording, actuator)
    if recording.interval_s <= SLOW_S:
        return None
    reason = _speed_complaint(recording, actuator) or _inertia_complaint(recording, actuator)
    if not reason:
        return None
    return (
        f"rows are {recording.interval_s:.4g} s apart, and {reason}: time_s seems to be in milliseconds, "
        "convert it to s"
    )


def _speed_complaint(recording: Recording, actuator: Actuator) -> str | None:
    """Compare the recorded speed with the derivative of the recorded position, or of the command."""
    if "speed_rad_s" not in recording:
        return None
    speed = np.diff(_motor_angle(recording, actuator)) / recording.interval_s
    measured = recording["speed_rad_s"][1:]
    motion_rms, sensor_rms = rms(speed), rms(measured)
    if not 0 < SPEED_RATIO * motion_rms < sensor_rms:
        return None
    # At rest both speeds are noise, with an arbitrary ratio.
    if float(np.mean(speed * measured)) < SAME_MOTION * motion_rms * sensor_rms:
        return None
    return f"the motor's speed is {sensor_rms / motion_rms:.3g} times that of its motion"


def _inertia_complaint(recording: Recording, actuator: Actuator) -> str | None:
    """Compare the inertia J estimated from the current with the described inertia.

    J follows from the least-squares fit k_t i = J α + C ω + F sgn ω + K θ + T_0 over the rows, with ω and α
    from differences of the angle θ. For a motion too slow to identify J, its standard error is large, and
    there is no complaint.
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


def _work_complaint(recording: Recording, actuator: Actuator) -> str | None:
    """Compare the energy J ω² / 2 of the recorded motion with the largest work k_t i_max Δθ of the motor.

    ω is the rms speed between the means of the angle over parts of the recording, Δθ the range of these
    means.
    """
    if "position_rad" not in recording or recording.samples < STRETCHES:
        return None
    # A command may jump, a position with inertia cannot.
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
