"""Fault levels at which each requirement fails."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.actuator.faults import HEALTHY, lower_bounds, present_components
from emaphm.arrays import Array
from emaphm.prognosis.requirements.margins import Limit, Requirements

POINTS, BETWEEN = 41, 17
"""Number of levels evaluated from the given level to the end of the scale, and then within the step in which
a measure fails; the failure level is interpolated linearly."""


@dataclass(frozen=True)
class FailureLevels:
    """Fault levels at which one limit fails.

    Attributes
    ----------
    value
        Limited quantity of the unit with the given faults, in the unit of the limit.
    levels
        For each component of the actuator, the first failure level above and below the given level; None if
        no level up to the end of the scale makes the limit fail.
    """

    limit: Limit
    value: float
    levels: Mapping[str, tuple[float | None, float | None]]

    @property
    def violated(self) -> bool:
        """Whether the given faults already violate the limit."""
        return float(self.limit.margin(np.asarray(self.value))) < 0

    @property
    def can_fail(self) -> bool:
        """Whether the given faults, or any single fault in addition, violate the limit."""
        return self.violated or any(level is not None for pair in self.levels.values() for level in pair)


def failure_levels(actuator: Actuator, faults: Faults = HEALTHY) -> tuple[FailureLevels, ...]:
    """Return the levels at which each requirement fails when one fault rises or falls from `faults`.

    An actuator without stated requirements has `FULL_SCALE`. An eccentricity rises in its direction in
    `faults`.

    Raises
    ------
    MethodError
        The averaged model did not stay finite.
    """
    requirements, start, lowest = Requirements(actuator), faults.vector, lower_bounds(actuator)
    present = present_components(actuator)
    sweeps = [
        (column, np.linspace(start[column], end, POINTS))
        for column in map(NAMES.index, present)
        for end in (1.0, lowest[column])
    ]
    vectors = [start[np.newaxis], *(_vectors(start, *sweep) for sweep in sweeps)]
    values = requirements.values(np.concatenate(vectors))
    results = []
    for limit, row in zip(requirements.limits, values, strict=True):
        margins = limit.margin(row[1:]).reshape(len(sweeps), POINTS)
        crossings = [
            _failure_level(requirements, limit, start, sweep, margin)
            for sweep, margin in zip(sweeps, margins, strict=True)
        ]
        pairs = {name: (crossings[2 * i], crossings[2 * i + 1]) for i, name in enumerate(present)}
        results.append(FailureLevels(limit, float(row[0]), pairs))
    return tuple(results)


def _vectors(start: Array, column: int, levels: Array) -> Array:
    """Return fault vectors (n, 8): `start` (8,) with its `column` set to each of the `levels` (n,)."""
    vectors = np.tile(start, (levels.size, 1))
    vectors[:, column] = levels
    return vectors


def _failure_level(
    requirements: Requirements, limit: Limit, start: Array, sweep: tuple[int, Array], margin: Array
) -> float | None:
    """Return the first level of a `sweep` at which the limit fails, given its margins (n,) there."""
    column, levels = sweep
    i = _first_failing(limit, margin)
    if i is None:
        return None
    if limit.component is None:  # A measure may jump, e.g. from settled to never: not to be interpolated.
        levels = np.linspace(levels[i - 1], levels[i], BETWEEN)
        margin = requirements.margins(_vectors(start, column, levels), [limit])[0]
        i = int(np.argmax(margin < 0))
    return _crossing(levels, margin, i)


def _first_failing(limit: Limit, margin: Array) -> int | None:
    """Return the index of the first failing margin (n,); None if none fails, or if the first one does."""
    # A given level equal to the limit does not fail; a level that rises to the limit fails, because its path
    # would continue. A measure equal to its limit does not fail: it may be quantised, or clipped to its
    # range.
    below = margin <= 0 if margin[0] > 0 and limit.component is not None else margin < 0
    if margin[0] < 0 or not below.any():
        return None  # violated already, not by the rise or fall of this fault
    return int(np.argmax(below))


def _crossing(levels: Array, margin: Array, i: int) -> float:
    """Return the level at which the margin (n,) falls to 0, between the levels i - 1 and i."""
    high, low = margin[i - 1], margin[i]
    share = high / (high - low) if np.isfinite(high) and np.isfinite(low) else 1.0
    return float(levels[i - 1] + share * (levels[i] - levels[i - 1]))
