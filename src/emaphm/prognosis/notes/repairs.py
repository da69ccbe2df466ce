"""Notes on shop findings: failures left open while a unit is in service, and what diagnoses contradict."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence


def repair_notes(evidence: "Evidence") -> list[str]:
    """Return notes on components that failed and were not replaced, and on a removal as failed without cause.

    None of these while the unit is out of service by a failure: its prognosis says so. Further, the notes on
    findings that contradict the diagnoses.
    """
    notes = [
        f"{' and '.join(one.components)} found failed at {one.hours:.9g} h, and no replacement is in the "
        "history: the unit counts as in service all the same, since another component was replaced, or it "
        "was flown or removed again; if it was not repaired, it has no remaining useful life"
        for one in evidence.not_replaced
    ]
    removed = evidence.open_removal
    if removed is not None:
        notes.append(
            f"the unit was removed as failed at {removed.hours:.9g} h, and the shop's findings of these "
            f"hours name only {', '.join(removed.named)}, none as failed: it counts as in service; if a "
            "finding is still to come, wait for it"
        )
    return [*notes, *evidence.contradictions]
