"""Check of the unit of a recorded motor angle against the motion in another channel.

It detects degrees, revolutions, milliradians, and the electrical in place of the mechanical angle.
"""

import math
from collections.abc import Sequence

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.recording.recording import Recording

LEAST_CORRELATION = 0.95
"""Least correlation between the angle and the motion that it is compared with."""

MATCHING_FACTOR = 1.15
"""Largest factor, in either direction, between the two motions if they have the same unit."""

LONGEST_DELAY, DELAYS = 0.1, 20
"""Longest delay of the motion behind its command that is tried, relative to the duration of the recording,
and the number of delays that are tried."""

SUSPICIOUS_FACTOR = 1.5
"""Least factor, in either direction, between the recorded motions: below, a wrong gear ratio is as likely."""


def angle_unit_complaint(recording: Recording, actuator: Actuator) -> str | None:
    """Return the reason why `angle_rad` seems not to be the motor's angle in rad, None if there is no reason.

    The angle is compared with the integral of the motor's recorded speed, or without a speed with the
    position or the command divided by the gear ratio.
    """
    if "angle_rad" not in recording or actuator.has_linear_motor:
        return None
    name, motion = _motion(recording, actuator)
    angle = recording["angle_rad"]
    delays = _delays(angle.size) if name == "command_rad" else [0]
    slope = _slope(np.unwrap(angle), motion, delays)
    if slope is not None and 1 / SUSPICIOUS_FACTOR <= slope <= SUSPICIOUS_FACTOR:
        return None
    for unit, size, wrapped in _candidate_units(actuator):
        # The angle is unwrapped in the unit of the recording: a turn is 360 if it is in degrees.
        turns = np.unwrap(angle / wrapped)
        converted_slope = _slope(turns * wrapped / size, motion, delays)
        if converted_slope is not None and 1 / MATCHING_FACTOR <= converted_slope <= MATCHING_FACTOR:
            return (
                f"angle_rad turns {size:.3g} times as far as the motor by {name}; it seems to be {unit}: "
                f"convert it to the motor's mechanical angle in rad{_alternative_remedy(name)}"
            )
    return None


def _alternative_remedy(name: str) -> str:
    return "" if name == "speed_rad_s" else ", or correct gear_ratio in the actuator's file"


def _candidate_units(actuator: Actuator) -> list[tuple[str, float, float]]:
    """Return the units that the angle may have: name, size of 1 rad of the motor, and turn over 2 pi."""
    degrees, turns = 180 / math.pi, 1 / (2 * math.pi)
    units = [
        ("in degrees", degrees, degrees),
        ("in revolutions", turns, turns),
        ("in milliradians", 1e3, 1e3),
    ]
    pairs = actuator.pole_pairs
    if pairs > 1:
        units += [
            ("the electrical angle", float(pairs), 1.0),
            ("the electrical angle in degrees", degrees * pairs, degrees),
        ]
    return units


def _motion(recording: Recording, actuator: Actuator) -> tuple[str, Array]:
    """Return the channel to compare with and the motor's angle computed from it, (samples,) [rad]."""
    if "speed_rad_s" in recording and np.any(recording["speed_rad_s"]):
        return "speed_rad_s", np.cumsum(recording["speed_rad_s"]) * recording.interval_s
    name = "position_rad" if "position_rad" in recording else "command_rad"
    return name, recording[name] / actuator.mechanics.gear_ratio


def _delays(rows: int) -> list[int]:
    """Return the delays [rows] at which a motion is compared with its command."""
    return [int(delay) for delay in np.unique(np.linspace(0, LONGEST_DELAY * rows, DELAYS).astype(int))]


def _slope(angle: Array, motion: Array, delays: Sequence[int]) -> float | None:
    """Return the ratio of the rms of `angle` to that of `motion` about their means, at the best of `delays`.

    The best delay [rows] has the largest correlation. None if no correlation exceeds `LEAST_CORRELATION`.
    """
    best, ratio = LEAST_CORRELATION, None
    for delay in delays:
        shifted, reference = angle[delay:] - angle[delay:].mean(), motion[: motion.size - delay]
        reference = reference - reference.mean()
        size, reference_size = float(np.linalg.norm(shifted)), float(np.linalg.norm(reference))
        if not (0 < size < math.inf and 0 < reference_size < math.inf):
            continue
        correlation = float(shifted @ reference) / (size * reference_size)
        if correlation > best:
            best, ratio = correlation, size / reference_size
    return ratio
