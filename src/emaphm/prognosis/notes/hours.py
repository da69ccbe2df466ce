"""A note on hours that only a shop's entry has: far behind the last recording they may be mistyped."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence


def hours_notes(evidence: "Evidence") -> list[str]:
    """Return a note where a unit has flown longer since its last recording than during all of them."""
    if not evidence.observations:
        return []
    first, last = evidence.observations[0].hours, evidence.observations[-1].hours
    if evidence.hours - last <= last - first:
        return []
    note = (
        f"the last recording is of {last:g} h, but a removal or a finding has {evidence.hours:g} h: what "
        "came in between is forecast; if those hours are wrong, 'emaphm history withdraw' takes the entry out"
    )
    return [note]
