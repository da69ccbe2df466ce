"""Note on levels that change faster than the largest rate of the filter, e.g. with hours in another unit."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.actuator.requirements import component_of
from emaphm.prognosis.filter.degradation import LARGEST_RATE
from emaphm.prognosis.notes.trend import Trend

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence

LEAST_SEEN = 3
"""Least number of diagnoses for the standard error of a line."""

SIGNIFICANT = 4.0
"""Standard errors by which a rate must exceed the largest rate."""


def rate_notes(evidence: "Evidence") -> list[str]:
    """Return a note on the components whose level changes faster than `LARGEST_RATE`, if any does."""
    rates_text = rates_too_fast(evidence)
    if not rates_text:
        return []
    note = (
        f"levels change faster than this forecast can follow, {LARGEST_RATE:g} per hour: {rates_text}; "
        "check the unit of the hours"
    )
    return [note]


def rates_too_fast(evidence: "Evidence") -> str:
    """Return components and rates [1/h] above `LARGEST_RATE` as text, empty if there are none."""
    rates: dict[str, float] = {}
    for column, name in enumerate(CARTESIAN_NAMES):
        rate = abs(_rate(evidence, column))
        if rate > LARGEST_RATE:
            component = component_of(name)
            rates[component] = max(rate, rates.get(component, 0.0))
    return ", ".join(f"{name} by {rate:.2g}" for name, rate in rates.items())


def _rate(evidence: "Evidence", column: int) -> float:
    """Return the rate of a level [1/h], 0 if it is not significantly above `LARGEST_RATE`.

    It is the slope of a straight line through the diagnoses since the component was new. A single jump, with
    most steps between diagnoses without a change, does not count.
    """
    diagnoses = evidence.since_replacement(column)
    hours = np.array([diagnosis.hours for diagnosis in diagnoses])
    if hours.size < LEAST_SEEN or np.ptp(hours) == 0:
        return 0.0
    level = np.array([diagnosis.level[column] for diagnosis in diagnoses])
    variances = np.array([diagnosis.covariance[column, column] for diagnosis in diagnoses])
    trend = Trend.of(hours, level, float(variances.mean()))
    steady = trend.median_slope * np.sign(trend.slope)
    least_rate = min(abs(trend.slope) - SIGNIFICANT * trend.standard_error, steady)
    return trend.slope if least_rate > LARGEST_RATE else 0.0
