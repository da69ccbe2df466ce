"""Seeded faults: their directions from healthy, and the one nearest to the direction of a deviation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.detection.level import Level
from emaphm.detection.result import Nearest
from emaphm.detection.settings import DetectorSettings


@dataclass(frozen=True, eq=False)
class Seeded:
    """Mean deviation (features,) of recordings with a seeded fault, at a load of a manoeuvre.

    `manoeuvre` is an index of the detector's manoeuvres, `load` of the manoeuvre's loads.
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
    """Return the seeded fault with the largest share of a deviation along its direction; None without faults.

    Directions are those of whitened features, whose healthy scatter is equal in all directions. The mean
    contribution of healthy scatter is subtracted from the squared deviation; the share is that of the
    remainder.

    Parameters
    ----------
    seeded
        Seeded faults of the detector. For each fault, those at the same load are used, or all of the
        manoeuvre if there is none at this load.
    level
        Level whose scatter whitens the features.
    place
        Indices of the manoeuvre and the load of the deviation.
    deviation
        Features less the healthy mean features, (1, features).
    """
    same_manoeuvre = [example for example in seeded if example.manoeuvre == place[0]]
    whitened = level.scatter.whitened(deviation)[0]
    excess = max(float(whitened @ whitened) - level.energy, 0.0)
    best: Nearest | None = None
    for fault in dict.fromkeys(example.fault for example in same_manoeuvre):
        examples = [example for example in same_manoeuvre if example.fault == fault]
        for example in [example for example in examples if example.load == place[1]] or examples:
            length = _projected_length(whitened, level.scatter.whitened(example.deviation))
            share = min(length**2 / excess, 1.0) if length > 0 and excess > 0 else 0.0
            if best is None or share > best.share:
                best = Nearest(fault, share, share >= settings.alike)
    return best


def _projected_length(deviation: Array, direction: Array) -> float:
    """Return the projection of `deviation` on `direction`, both (features,); 0 if `direction` is 0."""
    size = float(np.linalg.norm(direction))
    return float(deviation @ direction) / size if size > 0 else 0.0
