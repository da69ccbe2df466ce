"""Synthetic run-to-failure units, simulated independently of the filter's code.

Levels of friction and backlash degrade, each according to one law; the other levels are constant. Diagnoses
have correlated errors. Two of the laws, "saturating" and "steps", are not laws of the filter.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis.evidence import Evidence, Observation

KNOWN = ("linear", "exponential", "power law", "onset")
UNKNOWN = ("saturating", "steps")
HEALTHY = np.array([0, 0, 0, 0, 0, 0, 0, 0.5])
ERROR = 0.012
LIMIT = 0.6
"""Level at which friction and backlash fail."""


@dataclass(frozen=True)
class Truth:
    """Levels (m, 2) of friction and backlash at hours (m,), and the hours of the failure [h]."""

    unit: str
    law: str
    hours: Array
    level: Array
    failure: float


def truth(number: int, law: str) -> Truth:
    """Return a unit whose friction degrades according to `law` up to its failure; backlash grows slowly."""
    random = np.random.default_rng([7, number])
    life = float(np.exp(random.uniform(np.log(800), np.log(5000))))
    hours = np.arange(0.0, 4 * life, 5.0)
    drift = random.normal(0, 0.01 / np.sqrt(life), hours.size) * np.sqrt(5.0)
    friction = LIMIT * _shape(law, hours / life, random) + np.cumsum(drift)
    backlash = 0.2 * hours / life * random.random()
    level = np.stack([friction, backlash], axis=1)
    failed = np.flatnonzero(level.max(axis=1) >= LIMIT)
    end = failed[0]
    return Truth(f"synthetic {number}", law, hours[: end + 1], level[: end + 1], float(hours[end]))


def _shape(law: str, t: Array, random: np.random.Generator) -> Array:
    """Return the level of a law at times `t`: 0 at t = 0, about 1 at t = 1."""
    if law == "linear":
        return t
    if law == "exponential":
        rate = random.uniform(1, 4)
        return np.asarray(np.expm1(rate * np.minimum(t, 3)) / np.expm1(rate))
    if law == "power law":
        return np.asarray(t ** random.uniform(0.6, 2.5))
    if law == "onset":
        start = random.uniform(0.2, 0.6)
        return np.maximum(t - start, 0) / (1 - start)
    if law == "saturating":
        rate = random.uniform(0.5, 1.5)
        return np.asarray(np.expm1(-rate * t) / np.expm1(-rate))
    return np.asarray(np.cumsum(random.random(t.size) < 12 * t[1]) / 12)  # twelve steps in a life


def observed(unit: Truth, upto: float, every: float = 40.0) -> Evidence:
    """Return the unit's diagnoses up to `upto` flight hours [h]; each call returns the same diagnoses."""
    random = np.random.default_rng([8, int(unit.unit.split()[1])])
    observations = []
    for hours in np.arange(every, unit.failure, every):
        root = random.standard_normal((8, 12))
        scale = ERROR / np.sqrt(12)
        covariance = scale**2 * root @ root.T
        level = HEALTHY + scale * root @ random.standard_normal(12)
        level[:2] += unit.level[np.searchsorted(unit.hours, hours)]
        if hours <= upto:
            observations.append(Observation(float(hours), level, covariance, np.ones(8, bool)))
    return Evidence(unit.unit, "synthetic", observations[-1].hours, tuple(observations))
