"""Notes on levels whose forecast may be wrong: at the end of a scale, or an eccentricity that turns."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.actuator.requirements import LOWEST_FRICTION, component_of
from emaphm.arrays import Array
from emaphm.prognosis.bounds import to_the_end
from emaphm.prognosis.columns import ECCENTRICITY
from emaphm.prognosis.notes.trend import Trend

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence

AT_THE_END = 0.1
"""Probability of a level at or beyond the end of its scale from which on there is a note."""

TURNED = 0.5
"""Turn of the direction of an eccentricity from which on there is a note [rad]."""

STEADY = 0.5
"""Ratio of the median to the mean turn per hour, from which on an eccentricity turns steadily."""

LEAST_DIRECTIONS = 4
"""Least number of diagnoses for a usable standard error of a line through their directions."""

SIGNIFICANT = 4.0
"""Standard errors by which a turn, or the magnitude of an eccentricity with a direction, differs from 0."""


def level_notes(evidence: "Evidence", level: Array, least_friction: float = LOWEST_FRICTION) -> list[str]:
    """Return notes on samples (n, 8) of the present levels, and on the diagnoses."""
    notes = []
    at_end = np.mean(to_the_end(level, least_friction) == 0, axis=0) >= AT_THE_END
    names = dict.fromkeys(component_of(name) for name in _names(at_end))
    if names:
        notes.append(
            "may be at the end of its scale, so that a limit at that end has failed, or beyond the end, "
            f"where no diagnosis searches: {', '.join(names)}"
        )
    turned = turn_of_eccentricity(evidence)
    if abs(turned) > TURNED:
        notes.append(
            f"the direction of the eccentricity has turned by {np.degrees(abs(turned)):.0f}° over its "
            "diagnoses: the forecast extrapolates its two coordinates separately, so that a turn is taken "
            "for growth"
        )
    return notes


def turn_of_eccentricity(evidence: "Evidence") -> float:
    """Return the turn of the direction of an eccentricity [rad], 0 if it is not significant.

    It is the slope of a straight line through the directions, times the hours from the first to the last. A
    diagnosis has a direction if the magnitude exceeds `SIGNIFICANT` standard errors. A single jump, with most
    steps between diagnoses without a turn, does not count.
    """
    x, y = ECCENTRICITY
    diagnoses = [diagnosis for diagnosis in evidence.since_replacement(x) if diagnosis.seen[y]]
    error = np.array(
        [np.sqrt(max(diagnosis.covariance[x, x], diagnosis.covariance[y, y])) for diagnosis in diagnoses]
    )
    plane = np.array([diagnosis.level[[x, y]] for diagnosis in diagnoses]).reshape(-1, 2)
    has_direction = np.hypot(*plane.T) > SIGNIFICANT * error
    hours = np.array([diagnosis.hours for diagnosis in diagnoses])[has_direction]
    order = np.argsort(hours, kind="stable")
    hours, angle = hours[order], np.unwrap(np.arctan2(*plane[has_direction].T[::-1])[order])
    if hours.size < LEAST_DIRECTIONS or hours[0] == hours[-1]:
        return 0.0
    variance = np.mean((error / np.hypot(*plane.T))[has_direction] ** 2)
    trend = Trend.of(hours, angle, float(variance))
    is_significant = abs(trend.slope) > SIGNIFICANT * trend.standard_error
    if not is_significant or trend.median_slope / trend.slope < STEADY:
        return 0.0
    return trend.slope * float(hours[-1] - hours[0])


def _names(where: Array) -> list[str]:
    return [name for name, is_selected in zip(CARTESIAN_NAMES, where, strict=True) if is_selected]
