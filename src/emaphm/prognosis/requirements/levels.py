"""At which level of each fault each requirement fails."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.actuator.faults import HEALTHY, lower_bounds, present_components
from emaphm.arrays import Array
from emaphm.prognosis.requirements.margins import Limit, Requirements

POINTS, BETWEEN = 41, 17
"""Levels that are tried from the given one to the end of the scale, then between the two where a measure
fails, and interpolated linearly between."""


@dataclass(frozen=True)
class FailureLevels:
    """Where one limit fails.

    Attributes
    ----------
    value
        What it limits, of the unit with the given faults, in its unit.
    levels
        By component that the actuator has, the first levels beyond the given one at which it fails, upwards
        and downwards; None where no level up to the end of the scale does.
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
    requirements, start, lowest = Requirements(actuator), faults.vector, lower_bounds(actuator)
    present = present_components(actuator)
    ways = [
        (column, np.linspace(start[column], end, POINTS))
        for column in map(NAMES.index, present)
        for end in (1.0, lowest[column])
    ]
    vectors = [start[np.newaxis], *(_vectors(start, *one) for one in ways)]
    values = requirements.values(np.concatenate(vectors))
    results = []
    for limit, row in zip(requirements.limits, values, strict=True):
        margins = limit.margin(row[1:]).reshape(len(ways), POINTS)
        found = [
            _failing(requirements, limit, start, way, margin)
            for way, margin in zip(ways, margins, strict=True)
        ]
        pairs = {name: (found[2 * i], found[2 * i + 1]) for i, name in enumerate(present)}
        results.append(FailureLevels(limit, float(row[0]), pairs))
    return tuple(results)


def _vectors(start: Array, column: int, levels: Array) -> Array:
    """Return the faults `start` (8,) with each of the `levels` (n,) of one of them, (n, 8)."""
    vectors = np.tile(start, (levels.size, 1))
    vectors[:, column] = levels
    return vectors


def _failing(
    requirements: Requirements, limit: Limit, start: Array, way: tuple[int, Array], margin: Array
) -> float | None:
    """Return the first level on a `way` at which the limit fails, whose margin (n,) is known there."""
    column, levels = way
    i = _first_failing(limit, margin)
    if i is None:
        return None
    if limit.component is None:  # A measure may jump, as from settled to never: nothing to interpolate there.
        levels = np.linspace(levels[i - 1], levels[i], BETWEEN)
        margin = requirements.margins(_vectors(start, column, levels), [limit])[0]
        i = int(np.argmax(margin < 0))
    return _crossing(levels, margin, i)


def _first_failing(limit: Limit, margin: Array) -> int | None:
    """Return which of the margins (n,) is the first at which it fails; None where none is, or all are."""
    # At the very limit a level does not fail yet where it stands, and fails where it comes there, as its path
    # would go on. A measure holds its limit there: it may be quantised, or end at what is looked at.
    below = margin <= 0 if margin[0] > 0 and limit.component is not None else margin < 0
    if margin[0] < 0 or not below.any():
        return None  # violated already: growing or falling is not what makes it fail
    return int(np.argmax(below))


def _crossing(levels: Array, margin: Array, i: int) -> float:
    """Return the level at which the margin (n,) falls to 0, between the levels i - 1 and i."""
    high, low = margin[i - 1], margin[i]
    share = high / (high - low) if np.isfinite(low) else 1.0
    return float(levels[i - 1] + share * (levels[i] - levels[i - 1]))
