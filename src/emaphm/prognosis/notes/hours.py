"""Notes on hours far from all others, which may be mistyped: of a shop's entry, or of recordings."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence

LONG = 3.0
"""Ratio of a gap between diagnoses to all other hours between them, from which on a note says so."""

LEAST_SEEN = 3
"""Diagnoses before and after such a gap: fewer are of an acceptance test, or the first of a new habit."""


def hours_notes(evidence: "Evidence") -> list[str]:
    """Return notes where a unit has flown for long without a recording, since its last one or between them.

    For longer since its last one than during all of them; between two of them, for three times as long as
    between all others.
    """
    if not evidence.observations:
        return []
    notes = []
    hours = np.array([one.hours for one in evidence.observations])
    if evidence.hours - hours[-1] > hours[-1] - hours[0]:
        notes.append(
            f"the last recording is of {hours[-1]:.9g} h, but a removal or a finding has "
            f"{evidence.hours:.9g} h: what came in between is forecast; if those hours are wrong, "
            "'emaphm history withdraw' takes the entry out"
        )
    gaps = np.diff(hours)[LEAST_SEEN - 1 : 1 - LEAST_SEEN]
    longest = float(gaps.max(initial=0.0))
    if longest > LONG * (hours[-1] - hours[0] - longest):
        after = LEAST_SEEN + int(gaps.argmax())
        notes.append(
            f"no recording is from between {hours[after - 1]:.9g} and {hours[after]:.9g} h, {longest:.9g} of "
            f"the {hours[-1] - hours[0]:.9g} h from the first to the last: rates follow from these hours; if "
            "they are wrong, 'emaphm history withdraw' takes recordings out, to be added at the right ones"
        )
    return notes
