"""Warnings on a wrong sign, a wrong unit, or a channel that the calibrated model does not resemble.

A fit of wrong data also has an end point with small standard errors: with a current of the wrong sign, the
inertia is almost 0.
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
"""Residual's share of a channel's mean square above which the model does not resemble the channel, as in a
diagnosis (docs/physics.md, section 20)."""

EXPLAINED = 0.5
"""Least share of the current's partial variance that a part of the required current must explain, so that its
coefficient is meaningful."""

PER_M = 1000.0
"""Millimetres in a metre, milliamperes in an ampere."""

PER_RAD = 180 / np.pi
"""Degrees in a radian."""

DESCRIBED_WITHIN = 3.0
"""Largest factor by which a description may deviate, so that a unit is recognised."""


def calibration_warnings(
    rows: Sequence[CampaignRow], found: Sequence[RecordingResult], described: Actuator
) -> tuple[str, ...]:
    """Return a sentence on each recording whose current seems to have the wrong sign or unit.

    Further sentences name each channel that the calibrated model does not resemble. `found` are the results
    for the `rows`; `described` is the actuator before the calibration.
    """
    lines = []
    for row, result in zip(rows, found, strict=True):
        source = row.recording.source
        lines += [f"{source}: {text}" for text in (*unit_or_sign(row, described), *_unresembled(result))]
    return tuple(lines)


def _unresembled(result: RecordingResult) -> list[str]:
    """Return a sentence on each channel whose mean squared residual exceeds half of its mean square."""
    advice = "check its unit, its sign, its name under [channels], and the actuator's description"
    lines = []
    for name, error in result.replay.errors.items():
        rounding = (visible_count(result.replay.recording[name]) / ROUNDING) ** 2
        size = (error.rms / error.relative) ** 2 if error.relative else 0.0
        if error.relative is not None and error.rms**2 > UNRESEMBLED * size + rounding:
            lines.append(
                f"{name} is off by {100 * error.relative:.3g} % of its rms: the calibrated model does not "
                f"resemble it; {advice}"
            )
    if result.force_error is not None and result.force_error**2 > UNRESEMBLED:
        lines.append(
            f"the torque by the measured motion is off by {100 * result.force_error:.3g} % of its rms: the "
            f"parameters do not explain it; check the signs and units of motion and current"
        )
    return lines


def unit_or_sign(row: CampaignRow, described: Actuator) -> list[str]:
    """Return a sentence on a current of the wrong sign, or on a wrong unit that its size suggests."""
    gain = current_gain(row, described)
    if gain is None:
        return []
    ratio = f"current_A is {gain:.3g} times what the measured motion requires"
    if gain < 0:
        return [f"{ratio}, of the opposite sign: negate current_A, or the motion and its command"]
    length = described.has_linear_user
    unit, size, right = ("mm", PER_M, "m") if length else ("degrees", PER_RAD, "rad")
    if _near(gain, 1 / size):
        return [f"{ratio}, as of a position in {unit}: convert position and command to {right}"]
    return [f"{ratio}, as of a current in mA: convert it to A"] if _near(gain, PER_M) else []


def _near(gain: float, factor: float) -> bool:
    return bool(1 / DESCRIBED_WITHIN < gain / factor < DESCRIBED_WITHIN)


def current_gain(row: CampaignRow, described: Actuator) -> float | None:
    """Return the ratio of the recorded current to the current that the measured motion requires.

    It is about 1 for a correct description. The recorded current, in rows in which the shaft moves, is
    regressed on the current that accelerates the inertia, on that of friction and loads, and on a constant
    for an unknown load; the ratio is the coefficient of the first. If the first part is too small, the ratio
    is the coefficient of both parts together. None if no motion or current was recorded, or the current does
    not follow the motion.
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
        thinned(signal)
        for signal in (
            motion.response,
            response(motion, required_torque(motion, values), values),
            response(motion, required_torque(motion, {**values, "inertia": 0.0}), values),
        )
    )
    constant = np.ones_like(recorded)
    for part, other_parts in ((required - resisting, [resisting, constant]), (required, [constant])):
        design = np.stack(other_parts, axis=1)
        own, rest = (signal - design @ np.linalg.lstsq(design, signal)[0] for signal in (part, recorded))
        product = float(own @ rest)
        if product**2 > EXPLAINED * float(own @ own) * float(rest @ rest):
            return product / float(own @ own)
    return None
