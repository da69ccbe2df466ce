"""Failure times of the forecast paths for each requirement, and the component that is responsible."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.actuator import COMPONENTS, NAMES
from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array
from emaphm.prognosis.columns import columns_of, level_of
from emaphm.prognosis.forecast import Paths
from emaphm.prognosis.requirements.first_passage import first_passage
from emaphm.prognosis.requirements.margins import Limit, Requirements, vectors_of
from emaphm.prognosis.requirements.measure_passage import measure_passage
from emaphm.random_streams import stream

MOST_ATTRIBUTED = 200
"""Number of failures of a measure from which the most frequent responsible component is determined."""


@dataclass(frozen=True, eq=False)
class FailureTimes:
    """Failure times of n paths for each limit, (limits, n) [h] from now on, `inf` without a failure."""

    limits: tuple[Limit, ...]
    hours: Array

    @property
    def first(self) -> Array:
        """The RUL: time of the first failure of a requirement on each path, (n,) [h]."""
        return np.asarray(self.hours.min(axis=0))

    @property
    def sides(self) -> list[list[int]]:
        """Indices of the limits on one side of one level, for each such side, the tightest first."""
        return sides_of(self.limits)

    @property
    def commonest(self) -> int | None:
        """Index of the limit that most paths fail first; None if no path fails."""
        failed = self.hours.argmin(axis=0)[np.isfinite(self.first)]
        return int(np.bincount(failed).argmax()) if failed.size else None


def failure_times(forecast: Paths, requirements: Requirements, *, seed: int) -> FailureTimes:
    """Return the failure times of the paths for the requirements of an actuator.

    The first passage of a level is drawn exactly between two times of the forecast (`first_passage`). Several
    limits on one side of a level use the same path, so that a wider limit fails after a tighter limit. A
    limit at an end of the scale where the level is healthy does not fail, because only noise is beyond it. A
    measure fails at the first time of the path at which it violates its limit, interpolated
    (`measure_passage`).

    Raises
    ------
    MethodError
        The averaged model did not stay finite.
    """
    random = stream(seed, "forecast", "first passage")
    rows: dict[int, Array] = {}
    for side in sides_of(requirements.limits):
        passage: Array | float = 0.0
        tighter = requirements.limits[side[0]]
        for i in side:
            limit = requirements.limits[i]
            ahead = abs(limit.bound - tighter.bound)
            passage = first_passage(
                forecast.hours, *_margin_of_level(forecast, limit), random, passage, ahead
            )
            rows[i], tighter = np.where(limit.holds_always, np.inf, passage), limit
    measures = [limit for limit in requirements.limits if limit.component is None]
    if measures:
        rows |= {
            requirements.limits.index(limit): times
            for limit, times in zip(
                measures, _measure_failure_times(forecast, requirements, measures), strict=True
            )
        }
    return FailureTimes(requirements.limits, np.stack([rows[i] for i in range(len(rows))]))


def sides_of(limits: Sequence[Limit]) -> list[list[int]]:
    """Return indices of the `limits` on one side of one level, for each such side, the tightest first."""
    sides: dict[tuple[str, bool], list[int]] = {}
    for i, limit in enumerate(limits):
        if limit.component is not None:
            sides.setdefault((limit.component, limit.upper), []).append(i)
    return [
        sorted(side, key=lambda i: limits[i].bound if limits[i].upper else -limits[i].bound)
        for side in sides.values()
    ]


def responsible(forecast: Paths, times: FailureTimes, limit: int, requirements: Requirements) -> str | None:
    """Return the component whose degradation makes most paths fail a limit; None if there is none.

    For a measure, it is the component without whose fault the margin at the failure would be largest.
    Failures at which the margin would be the same without any of the faults are ignored.
    """
    failed_limit = times.limits[limit]
    if failed_limit.component is not None:
        return failed_limit.component
    failed = np.flatnonzero(np.isfinite(times.hours[limit]))[:MOST_ATTRIBUTED]
    if not failed.size:
        return None
    steps = np.searchsorted(forecast.hours, times.hours[limit][failed])
    vectors = vectors_of(
        forecast.level[np.minimum(steps, forecast.hours.size - 1), failed], requirements.actuator
    )
    without = np.repeat(vectors[np.newaxis], len(COMPONENTS), axis=0)
    for i, name in enumerate(COMPONENTS):
        without[i, :, NAMES.index(name)] = HEALTHY.vector[NAMES.index(name)]
    margins = requirements.margins(without.reshape(-1, len(NAMES)), [failed_limit]).reshape(
        len(COMPONENTS), -1
    )
    margins = margins[:, margins.max(axis=0) > margins.min(axis=0)]
    if not margins.size:
        return None
    best = margins.argmax(axis=0)
    return COMPONENTS[int(np.bincount(best, minlength=len(COMPONENTS)).argmax())]


def _margin_of_level(forecast: Paths, limit: Limit) -> tuple[Array, Array]:
    """Return the margin (m, n) of a limit on a level, and the noise (m - 1, n) of its Wiener process."""
    name = str(limit.component)
    noise = forecast.noise[:, :, columns_of(name)].max(axis=2)
    return limit.margin(level_of(forecast.level, name)), np.asarray(noise)


def _measure_failure_times(forecast: Paths, requirements: Requirements, measures: list[Limit]) -> list[Array]:
    """Return the failure times (n,) for each of the limits `measures`."""
    now, last = (
        requirements.margins(vectors_of(level, requirements.actuator), measures)
        for level in (forecast.level[0], forecast.level[-1])
    )
    return [
        measure_passage(forecast, requirements, limit, *ends)
        for limit, *ends in zip(measures, now, last, strict=True)
    ]
