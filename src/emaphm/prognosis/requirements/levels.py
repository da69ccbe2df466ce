"""At which level of each fault each requirement fails."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from emaphm.actuator import COMPONENTS, NAMES, Actuator, Faults
from emaphm.actuator.faults import HEALTHY, lower_bounds
from emaphm.arrays import Array
from emaphm.prognosis.requirements.margins import Limit, Requirements

POINTS = 41
"""Levels that are tried from the given one to the end of the scale, and interpolated linearly between."""


@dataclass(frozen=True)
class FailureLevels:
    """Where one limit fails.

    Attributes
    ----------
    value
        What it limits, of the unit with the given faults, in its unit.
    levels
        By component, the first levels beyond the given one at which it fails, upwards and downwards; None
        where no level up to the end of the scale does.
    """

    limit: Limit
    value: float
    levels: Mapping[str, tuple[float | None, float | None]]

    @property
    def violated(self) -> bool:
        """Whether it fails already with the given faults."""
        return float(self.limit.margin(np.asarray(self.value))) < 0

    @property
    def can_fail(self) -> bool:
        """Whether any single fault, or what is given, makes it fail."""
        return self.violated or any(level is not None for pair in self.levels.values() for level in pair)


def failure_levels(actuator: Actuator, faults: Faults = HEALTHY) -> tuple[FailureLevels, ...]:
    """Return where each requirement fails as one fault grows or falls, the others being as in `faults`.

    An actuator that states no requirement has `FULL_SCALE`. An eccentricity grows in its direction in
    `faults`.

    Raises
    ------
    MethodError
        The averaged model did not stay finite.
    """
    requirements, start = Requirements(actuator), faults.vector
    blocks, ways, lowest = [start[np.newaxis]], [], lower_bounds(actuator)
    for name in COMPONENTS:
        column = NAMES.index(name)
        for end in (1.0, float(lowest[column])):
            block = np.tile(start, (POINTS, 1))
            block[:, column] = np.linspace(start[column], end, POINTS)
            blocks.append(block)
            ways.append((name, block[:, column]))
    values = requirements.values(np.concatenate(blocks))
    results = []
    for limit, row in zip(requirements.limits, values, strict=True):
        margins = limit.margin(row[1:]).reshape(len(ways), POINTS)
        found = [_crossing(limit, *one) for one in zip((levels for _, levels in ways), margins, strict=True)]
        pairs = {name: (found[2 * i], found[2 * i + 1]) for i, name in enumerate(COMPONENTS)}
        results.append(FailureLevels(limit, float(row[0]), pairs))
    return tuple(results)


def _crossing(limit: Limit, levels: Array, margin: Array) -> float | None:
    """Return the first level (of n) at which the margin (n,) falls to 0, None where it never does."""
    # At the very limit a level does not fail yet where it stands, and fails where it comes there, as its path
    # would go on. A measure holds its limit there: it may be quantised, or end at what is looked at.
    below = margin <= 0 if margin[0] > 0 and limit.component is not None else margin < 0
    if margin[0] < 0 or not below.any():
        return None  # violated already: growing or falling is not what makes it fail
    i = int(np.argmax(below))
    high, low = margin[i - 1], margin[i]
    share = high / (high - low) if np.isfinite(low) else 1.0
    return float(levels[i - 1] + share * (levels[i] - levels[i - 1]))
