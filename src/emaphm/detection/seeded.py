"""Seeded faults: in which direction each lies from healthy, and along which of them a deviation is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.detection.level import Level
from emaphm.detection.result import Nearest
from emaphm.detection.settings import DetectorSettings


@dataclass(frozen=True, eq=False)
class Seeded:
    """Mean deviation of recordings with a seeded fault, (features,), at a load of a manoeuvre.

    `manoeuvre` and `load` are the places in the detector's and the manoeuvre's list.
    """

    fault: str
    manoeuvre: int
    load: int
    deviation: Array


def nearest_seeded(
    seeded: Sequence[Seeded],
    level: Level,
    place: tuple[int, int],
    deviation: Array,
    settings: DetectorSettings,
) -> Nearest | None:
    """Return the seeded fault along whose direction most of a deviation lies; None where there are none.

    Directions are those of whitened features, in which healthy scatter is alike in all directions. Of the
    squared deviation, what healthy scatter has in the mean is no fault's; the share is of the rest.

    Parameters
    ----------
    seeded
        Of the detector. Those at the same load count, or those of the manoeuvre where a fault has none there.
    level
        Whose scatter whitens.
    place
        Manoeuvre and load of the deviation, by their places.
    deviation
        Features less the healthy ones, (1, features).
    """
    others = [one for one in seeded if one.manoeuvre == place[0]]
    found = level.scatter.whitened(deviation)[0]
    excess = max(float(found @ found) - level.energy, 0.0)
    best: Nearest | None = None
    for fault in dict.fromkeys(one.fault for one in others):
        ones = [one for one in others if one.fault == fault]
        for one in [one for one in ones if one.load == place[1]] or ones:
            along = _along(found, level.scatter.whitened(one.deviation))
            share = min(along**2 / excess, 1.0) if along > 0 and excess > 0 else 0.0
            if best is None or share > best.share:
                best = Nearest(fault, share, share >= settings.alike)
    return best


def _along(deviation: Array, direction: Array) -> float:
    """Return the length of `deviation` along `direction`, (features,) both; 0 where that has none."""
    size = float(np.linalg.norm(direction))
    return float(deviation @ direction) / size if size > 0 else 0.0
