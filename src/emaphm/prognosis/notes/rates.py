"""A note on levels that change faster than the filter lets them: mostly hours in another unit."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array
from emaphm.prognosis.columns import columns_of
from emaphm.prognosis.filter.degradation import LARGEST_RATE

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence

LEAST_SEEN = 3
"""Diagnoses from which on a line through them has a standard error."""

SIGNIFICANT = 4.0
"""Standard errors by which a rate is above the largest."""


def rate_notes(evidence: "Evidence") -> list[str]:
    """Return a note on the components whose level changes faster than `LARGEST_RATE`, if any does."""
    rates: dict[str, float] = {}
    for column, name in enumerate(CARTESIAN_NAMES):
        rate = abs(_rate(evidence, column))
        component = name.removesuffix("_x").removesuffix("_y")
        if rate > LARGEST_RATE:
            rates[component] = max(rate, rates.get(component, 0.0))
    if not rates:
        return []
    found = ", ".join(f"{name} by {rate:.2g}" for name, rate in rates.items())
    note = (
        f"levels change faster than this forecast can follow, {LARGEST_RATE:g} per hour: {found}; check the "
        "unit of the hours"
    )
    return [note]


def _rate(evidence: "Evidence", column: int) -> float:
    """Return how fast a level changes [1/h], 0 where that is not significantly above `LARGEST_RATE`.

    The slope of a straight line through its diagnoses since it was new. A single jump, which leaves most
    steps from one diagnosis to the next without a change, is no rate.
    """
    since = max((hours for hours, part in evidence.replacements if column in columns_of(part)), default=-1.0)
    seen = [one for one in evidence.used if one.hours > since and one.seen[column]]
    hours = np.array([one.hours for one in seen])
    if hours.size < LEAST_SEEN or np.ptp(hours) == 0:
        return 0.0
    level = np.array([one.level[column] for one in seen])
    own = np.array([one.covariance[column, column] for one in seen])
    slope, deviation = _line(hours - hours.mean(), level, own)
    later = np.diff(hours) > 0
    steady = np.median(np.diff(level)[later] / np.diff(hours)[later]) * np.sign(slope)
    above = min(abs(slope) - SIGNIFICANT * deviation, steady)
    return slope if above > LARGEST_RATE else 0.0


def _line(centred: Array, level: Array, own: Array) -> tuple[float, float]:
    """Return slope and standard error of a line through levels, `own` their variances at least."""
    size = float(centred @ centred)
    slope = float(centred @ level) / size
    rest = level - level.mean() - slope * centred
    variance = max(float(rest @ rest) / (level.size - 2), float(own.mean()))
    return slope, float(np.sqrt(variance / size))
