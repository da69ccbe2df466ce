"""Degradation trajectories of other units, as a law that a unit may follow on its own time scale."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.prognosis.columns import ECCENTRICITY, level_of

if TYPE_CHECKING:
    from collections.abc import Sequence

POINTS = 65
"""Number of points of a trajectory, equally spaced over its span: units have ten to a hundred diagnoses."""

FEWEST = 3
"""Least number of diagnoses of a trajectory."""

END = 0.2
"""Last share of a span, from which the slope is extrapolated."""

EXPONENTS = 0.5, 3.0
"""Range of the exponent of an extrapolation, as of power laws in the general prior."""

LEAST_CHANGE = 0.02
"""Least change of a level over its span for an estimate of the exponent."""


@dataclass(frozen=True, eq=False)
class ReferenceTrajectories:
    """Degradation trajectories of the components of k other units.

    After its end a trajectory is extrapolated by a straight line or by a power of the age,

        L(s) = L(1) + L' (s^p - 1) / p,    p = L' s' / L(s'),

    with equal probability. L' is the slope over the last fifth of its span, and s' = 0.9 is the middle of
    this fifth. Beyond the observed levels, wear may have started late and continue evenly, or accelerate or
    slow down as before. For a power law, p is its exponent.

    Attributes
    ----------
    change
        Change of each level since the component was new, (k, 8, m), at m equally spaced shares of the span,
        from 0 to 1. Both coordinates of an eccentricity have the change of the magnitude, because the
        direction differs between units.
    span
        Hours over which the component was followed [h], (k, 8); 0 if it was not.
    exponent
        p of the extrapolation, (k, 8); 1 is a straight line.
    """

    change: Array
    span: Array
    exponent: Array

    @classmethod
    def of(cls, trajectories: "Sequence[Trajectory]") -> "ReferenceTrajectories":
        """Return the trajectories of one or more units twice: with linear, then with power extrapolation."""
        change, span = (
            np.stack(columns) for columns in zip(*map(_changes_and_spans, trajectories), strict=True)
        )
        # dL/ds s/L over the last part of the span, with the means of s and L there.
        before, last = _ends(change)
        level = (change[..., before] + change[..., last]) / 2
        has_form = np.abs(level) > LEAST_CHANGE
        share = (before / last + 1) / 2
        power = np.where(has_form, _last_slope(change) * share / np.where(has_form, level, 1.0), 1.0)
        exponent = np.concatenate([np.ones(span.shape), np.clip(power, *EXPONENTS)])
        return cls(np.concatenate([change, change]), np.concatenate([span, span]), exponent)

    def drawn(self, shape: tuple[int, int], random: np.random.Generator) -> tuple[NDArray[np.intp], Array]:
        """Return units (n, 8), drawn uniformly from those with a trajectory of the component, and spans [h].

        The span is 0 if no unit has a trajectory.
        """
        is_followed = self.span > 0
        order = np.argsort(~is_followed, axis=0, kind="stable")
        place = (random.random(shape) * np.maximum(is_followed.sum(axis=0), 1)).astype(int)
        columns = np.broadcast_to(np.arange(shape[1]), shape)
        units = order[place, columns]
        return units, self.span[units, columns]

    def change_at(self, unit: NDArray[np.intp], share: Array, column: NDArray[np.intp]) -> Array:
        """Return the change of the `unit`'s component `column` at a `share` of its span, in any shape."""
        last = self.change.shape[2] - 1
        place = np.clip(share, 0.0, 1.0) * last
        low = np.minimum(place.astype(int), last - 1)
        start, end = self.change[unit, column, low], self.change[unit, column, low + 1]
        power = self.exponent[unit, column]
        beyond = (np.maximum(share, 1.0) ** power - 1.0) / power
        return np.asarray(start + (place - low) * (end - start) + self._slope[unit, column] * beyond)

    @cached_property
    def _slope(self) -> Array:
        return _last_slope(self.change)


def _last_slope(change: Array) -> Array:
    """Return the slope (…) of trajectories (…, m) per span, over the last share `END`."""
    before, last = _ends(change)
    return np.asarray((change[..., last] - change[..., before]) / (1 - before / last))


def _ends(change: Array) -> tuple[int, int]:
    """Return the first and last index of the last share `END` of trajectories (…, m)."""
    last = change.shape[-1] - 1
    return round((1 - END) * last), last


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The filtered levels (n, 8) of a unit at flight `hours` (n,) [h], from `new_at` (8,) to `until` (8,).

    Each component was new at the hours `new_at` and replaced at `until`, `inf` without a replacement. `age`
    (n, 8) [h] is the ageing of each component at `hours`, under its stress; `new` are the levels (8,) of a
    new unit.
    """

    hours: Array
    age: Array
    level: Array
    new_at: Array
    until: Array
    new: Array


def _changes_and_spans(trajectory: Trajectory) -> tuple[Array, Array]:
    """Return the changes (8, m) and spans (8,) of one unit."""
    components = trajectory.level.shape[1]
    change = trajectory.level - trajectory.new
    change[:, ECCENTRICITY] = level_of(trajectory.level, "eccentricity")[:, np.newaxis]
    changes, span = np.zeros((components, POINTS)), np.zeros(components)
    for c, (new_at, until) in enumerate(zip(trajectory.new_at, trajectory.until, strict=True)):
        rows = (trajectory.hours > new_at) & (trajectory.hours <= until)
        if rows.sum() < FEWEST:
            continue
        # Two recordings of one flight may change the estimated age in either direction.
        ages = np.maximum.accumulate(np.concatenate([[0.0], trajectory.age[rows, c]]))
        values = np.concatenate([[0.0], change[rows, c]])
        span[c] = ages[-1]
        changes[c] = np.interp(np.linspace(0, span[c], POINTS), ages, values)
    return changes, span
