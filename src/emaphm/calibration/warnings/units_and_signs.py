"""What makes a calibration worthless in spite of its standard errors: a sign, a unit, an unlike channel.

A fit ends somewhere, whatever it is given: with a current of the wrong sign, at an inertia of almost nothing.
"""

from collections.abc import Sequence

import numpy as np

from emaphm.actuator import Actuator
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.findings import RecordingResult
from emaphm.errors import EmaphmError
from emaphm.estimation.inverse_dynamics.filtering import RowThinning
from emaphm.estimation.inverse_dynamics.fit import described_values
from emaphm.estimation.inverse_dynamics.motion import Motion
from emaphm.estimation.inverse_dynamics.torque_balance import required_torque, response
from emaphm.estimation.sensors.counts import ROUNDING, visible_count

UNRESEMBLED = 0.5
"""Share of a channel's mean square above which a model does not resemble it, as in a diagnosis (physics,
section 20)."""

EXPLAINED = 0.5
"""Least share of the current's variance, of what the other parts leave of it, that a part of the required
current explains for its coefficient to say anything."""

PER_M = 1000.0
"""Millimetres in a metre, milliamperes in an ampere."""

PER_RAD = 180 / np.pi
"""Degrees in a radian."""

DESCRIBED_WITHIN = 3.0
"""Factor that a description may be off by, so that a unit is recognised."""


def calibration_warnings(
    rows: Sequence[CampaignRow], found: Sequence[RecordingResult], described: Actuator
) -> tuple[str, ...]:
    """Return a sentence on each recording whose current has the wrong sign, or another unit, as it seems.

    And on each channel that the calibrated model does not resemble. `described` is the actuator before the
    calibration.
    """
    lines = []
    for row, one in zip(rows, found, strict=True):
        source = row.recording.source
        lines += [f"{source}: {text}" for text in (*unit_or_sign(row, described), *_unlike(one))]
    return tuple(lines)


def _unlike(one: RecordingResult) -> list[str]:
    """Return a sentence on each channel of which more than half of the mean square is left."""
    advice = "check its unit, its sign, its name under [channels], and the actuator's description"
    lines = []
    for name, error in one.replay.errors.items():
        rounding = (visible_count(one.replay.recording[name]) / ROUNDING) ** 2
        size = (error.rms / error.relative) ** 2 if error.relative else 0.0
        if error.relative is not None and error.rms**2 > UNRESEMBLED * size + rounding:
            lines.append(
                f"{name} is off by {100 * error.relative:.3g} % of its rms: the calibrated model does not "
                f"resemble it; {advice}"
            )
    if one.force_error is not None and one.force_error**2 > UNRESEMBLED:
        lines.append(
            f"the torque by the measured motion is off by {100 * one.force_error:.3g} % of its rms: the "
            f"parameters do not explain it; check the signs and units of motion and current"
        )
    return lines


def unit_or_sign(row: CampaignRow, described: Actuator) -> list[str]:
    """Return a sentence on a current of the wrong sign, or on a unit that its size suggests."""
    gain = current_gain(row, described)
    if gain is None:
        return []
    found = f"current_A is {gain:.3g} times what the measured motion requires"
    if gain < 0:
        return [f"{found}, of the opposite sign: negate current_A, or the motion and its command"]
    length = described.has_linear_user
    unit, size, right = ("mm", PER_M, "m") if length else ("degrees", PER_RAD, "rad")
    if _near(gain, 1 / size):
        return [f"{found}, as of a position in {unit}: convert position and command to {right}"]
    return [f"{found}, as of a current in mA: convert it to A"] if _near(gain, PER_M) else []


def _near(gain: float, factor: float) -> bool:
    return bool(1 / DESCRIBED_WITHIN < gain / factor < DESCRIBED_WITHIN)


def current_gain(row: CampaignRow, described: Actuator) -> float | None:
    """Return the recorded current relative to that which the measured motion requires of the description.

    About 1 of a right description, by the rows in which the shaft moves: the coefficient of the current that
    accelerates the inertia, in a regression on it, on that of friction and loads and on a constant, for an
    unknown load. Where that part is too small, the coefficient of both together. None where no motion or
    current was recorded, or the current does not follow the motion.
    """
    try:
        motion = Motion.of(row.completed(), row.described(described))
    except EmaphmError:
        return None
    if motion.channel != "current_A":
        return None
    values = described_values(row.described(described))
    thinned = RowThinning.of(motion.moving, motion.frequencies.regression_hz, motion.interval)
    recorded, required, resisting = (
        thinned(one)
        for one in (
            motion.response,
            response(motion, required_torque(motion, values), values),
            response(motion, required_torque(motion, {**values, "inertia": 0.0}), values),
        )
    )
    constant = np.ones_like(recorded)
    for part, others in ((required - resisting, [resisting, constant]), (required, [constant])):
        known = np.stack(others, axis=1)
        own, rest = (one - known @ np.linalg.lstsq(known, one)[0] for one in (part, recorded))
        shared = float(own @ rest)
        if shared**2 > EXPLAINED * float(own @ own) * float(rest @ rest):
            return shared / float(own @ own)
    return None
