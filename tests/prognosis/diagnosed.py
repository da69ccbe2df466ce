"""Evidence of a synthetic unit with a diagnosis every 50 h and given levels."""

from collections.abc import Callable

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis import Evidence, Observation
from emaphm.prognosis.prior import NEW

ERROR = 0.006


def diagnosed(level: Callable[[float], Array], *, seed: int = 0, error: float = ERROR) -> Evidence:
    random = np.random.default_rng(seed)
    observations = tuple(
        Observation(
            hours,
            NEW + level(hours) + error * random.standard_normal(8),
            error**2 * np.eye(8),
            np.ones(8, bool),
        )
        for hours in np.arange(50.0, 1001.0, 50.0).tolist()
    )
    return Evidence("S1", "P1", 1000.0, observations)


def at(friction: float) -> Array:
    return np.array([friction, 0, 0, 0, 0, 0, 0, 0])
