"""Notes on long gaps in the flight hours of recordings and shop entries, which may be typing errors."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence

LONG = 3.0
"""Ratio of a gap between diagnoses to the sum of the other gaps, from which on there is a note."""

LEAST_SEEN = 3
"""Least number of diagnoses before and after such a gap: fewer may be an acceptance test, or a first
series."""


def hours_notes(evidence: "Evidence") -> list[str]:
    """Return notes if a unit has flown for long without a recording.

    The gap since the last recording must be longer than the hours from the first to the last recording; a gap
    between two recordings must be three times as long as all other gaps together.
    """
    if not evidence.observations:
        return []
    notes = []
    hours = np.array([observation.hours for observation in evidence.observations])
    if evidence.hours - hours[-1] > hours[-1] - hours[0]:
        notes.append(
            f"the last recording is of {hours[-1]:.9g} h, but a removal or a finding has "
            f"{evidence.hours:.9g} h: the hours in between are forecast; if the hours of the entry are "
            "wrong, withdraw it with 'emaphm history withdraw'"
        )
    gaps = np.diff(hours)[LEAST_SEEN - 1 : 1 - LEAST_SEEN]
    longest = float(gaps.max(initial=0.0))
    if longest > LONG * (hours[-1] - hours[0] - longest):
        after = LEAST_SEEN + int(gaps.argmax())
        notes.append(
            f"there is no recording between {hours[after - 1]:.9g} and {hours[after]:.9g} h, {longest:.9g} "
            f"of the {hours[-1] - hours[0]:.9g} h from the first to the last: rates follow from these "
            "hours; if they are wrong, withdraw the recordings with 'emaphm history withdraw' and add them "
            "again"
        )
    return notes
