"""A motor angle in another unit, or of the electrical turn, found by the motion in another channel."""

import math
from collections.abc import Sequence

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.recording.recording import Recording

ALIKE = 0.95
"""Least correlation of the angle's changes with those of the motion that it is compared with."""

MATCHES = 1.15
"""Largest factor, either way, between the two motions where they are of one unit."""

LATEST_SHARE, DELAYS = 0.1, 20
"""Longest delay of a motion behind its command that is tried, a share of the recording, and their number."""

DIFFERS = 1.5
"""Least factor, either way, between them as recorded: below, another gear ratio is as likely."""


def angle_unit_complaint(recording: Recording, actuator: Actuator) -> str | None:
    """Return why `angle_rad` seems to be in another unit than rad of the motor, None where nothing says so.

    It is compared with the motor's recorded speed, else with the position or the command over the gear ratio.
    """
    if "angle_rad" not in recording or actuator.has_linear_motor:
        return None
    name, motion = _motion(recording, actuator)
    angle = recording["angle_rad"]
    delays = _delays(angle.size) if name == "command_rad" else [0]
    slope = _slope(np.unwrap(angle), motion, delays)
    if slope is not None and 1 / DIFFERS <= slope <= DIFFERS:
        return None
    for unit, size, wrapped in _units(actuator):
        # Turns are counted in the unit of the recording: 360 where it has degrees.
        turns = np.unwrap(angle / wrapped)
        matched = _slope(turns * wrapped / size, motion, delays)
        if matched is not None and 1 / MATCHES <= matched <= MATCHES:
            return (
                f"angle_rad turns {size:.3g} times as far as the motor by {name}; it seems to be {unit}: "
                f"convert it to the motor's mechanical angle in rad{_else(name)}"
            )
    return None


def _else(name: str) -> str:
    return "" if name == "speed_rad_s" else ", or correct gear_ratio in the actuator's file"


def _units(actuator: Actuator) -> list[tuple[str, float, float]]:
    """Return what an angle may be in, by how much that is larger, and what its turn is over 2 pi."""
    degrees, turns = 180 / math.pi, 1 / (2 * math.pi)
    units = [
        ("in degrees", degrees, degrees),
        ("in revolutions", turns, turns),
        ("in milliradians", 1e3, 1e3),
    ]
    pairs = 1 if actuator.electrical is None else actuator.electrical.pole_pairs
    if pairs > 1:
        units += [
            ("the electrical angle", float(pairs), 1.0),
            ("the electrical angle in degrees", degrees * pairs, degrees),
        ]
    return units


def _motion(recording: Recording, actuator: Actuator) -> tuple[str, Array]:
    """Return the channel that shows the motor's motion best, and the motor's angle by it (samples,) [rad]."""
    if "speed_rad_s" in recording and np.any(recording["speed_rad_s"]):
        return "speed_rad_s", np.cumsum(recording["speed_rad_s"]) * recording.interval_s
    name = "position_rad" if "position_rad" in recording else "command_rad"
    return name, recording[name] / actuator.mechanics.gear_ratio


def _delays(rows: int) -> list[int]:
    """Return the delays [rows] at which a motion is compared with its command."""
    return [int(one) for one in np.unique(np.linspace(0, LATEST_SHARE * rows, DELAYS).astype(int))]


def _slope(angle: Array, motion: Array, delays: Sequence[int]) -> float | None:
    """Return the ratio of an angle to a motion about their means, at the delay [rows] of the most likeness.

    None where they are alike at no delay.
    """
    best, ratio = ALIKE, None
    for delay in delays:
        off, asked = angle[delay:] - angle[delay:].mean(), motion[: motion.size - delay]
        asked = asked - asked.mean()
        size, reference = float(np.linalg.norm(off)), float(np.linalg.norm(asked))
        if not (0 < size < math.inf and 0 < reference < math.inf):
            continue
        correlation = float(off @ asked) / (size * reference)
        if correlation > best:
            best, ratio = correlation, size / reference
    return ratio
