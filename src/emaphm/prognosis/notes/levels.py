"""Notes on levels of which a forecast may be wrong: at the end of a scale, or turning."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.actuator.requirements import LOWEST_FRICTION
from emaphm.arrays import Array
from emaphm.prognosis.bounds import to_the_end
from emaphm.prognosis.columns import ECCENTRICITY, columns_of

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence

AT_THE_END = 0.1
"""Probability of a level at or beyond the end of its scale from which on a note says so."""

TURNED = 0.5
"""Angle by which the direction of an eccentricity has turned, from which on a note says so [rad]."""

STEADY = 0.5
"""Ratio of the median turn an hour to the mean one, from which on an eccentricity turns steadily."""

LEAST_DIRECTIONS = 4
"""Diagnoses from which on a line through their directions has a standard error worth the name."""

SIGNIFICANT = 4.0
"""Standard errors by which a turn, or an eccentricity that has a direction at all, differs from none."""


def level_notes(evidence: "Evidence", level: Array, least_friction: float = LOWEST_FRICTION) -> list[str]:
    """Return notes on the levels (n, 8) that may be now, and on the diagnoses they follow from."""
    notes = []
    at_end = np.mean(to_the_end(level, least_friction) == 0, axis=0) >= AT_THE_END
    names = dict.fromkeys(name.removesuffix("_x").removesuffix("_y") for name in _names(at_end))
    if names:
        notes.append(
            "may be at the end of its scale, where a limit at that end has failed, or beyond, where no "
            f"diagnosis looks: {', '.join(names)}"
        )
    turned = turn_of_eccentricity(evidence)
    if abs(turned) > TURNED:
        notes.append(
            f"the direction of the eccentricity has turned by {np.degrees(abs(turned)):.0f}° over its "
            "diagnoses: the forecast lets each of its two coordinates go on, and so takes a turn for growth"
        )
    return notes


def turn_of_eccentricity(evidence: "Evidence") -> float:
    """Return by how much the direction of an eccentricity has turned [rad], 0 where no turn is significant.

    The slope of a straight line through the directions, times the hours from the first to the last. Of
    diagnoses whose eccentricity has a direction: a magnitude of `SIGNIFICANT` standard errors. A single jump,
    which leaves most steps from one diagnosis to the next without a turn, is none.
    """
    x, y = ECCENTRICITY
    since = max((hours for hours, part in evidence.replacements if x in columns_of(part)), default=-1.0)
    seen = [one for one in evidence.used if one.hours > since and one.seen[[x, y]].all()]
    error = np.array([np.sqrt(max(one.covariance[x, x], one.covariance[y, y])) for one in seen])
    plane = np.array([one.level[[x, y]] for one in seen]).reshape(-1, 2)
    known = np.hypot(*plane.T) > SIGNIFICANT * error
    hours = np.array([one.hours for one in seen])[known]
    order = np.argsort(hours, kind="stable")
    hours, angle = hours[order], np.unwrap(np.arctan2(*plane[known].T[::-1])[order])
    if hours.size < LEAST_DIRECTIONS or hours[0] == hours[-1]:
        return 0.0
    centred = hours - hours.mean()
    slope = float(centred @ angle / (centred @ centred))
    rest = angle - angle.mean() - slope * centred
    own = np.mean((error / np.hypot(*plane.T))[known] ** 2)
    deviation = np.sqrt(max(float(rest @ rest) / (hours.size - 2), float(own)) / (centred @ centred))
    later = np.diff(hours) > 0
    steady = float(np.median(np.diff(angle)[later] / np.diff(hours)[later]))
    if abs(slope) <= SIGNIFICANT * deviation or steady / slope < STEADY:
        return 0.0
    return slope * float(hours[-1] - hours[0])


def _names(where: Array) -> list[str]:
    return [name for name, is_so in zip(CARTESIAN_NAMES, where, strict=True) if is_so]
