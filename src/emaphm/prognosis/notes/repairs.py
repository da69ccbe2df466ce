"""Notes on shop findings: unrepaired failures of a unit in service, and contradictions with diagnoses."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence


def repair_notes(evidence: "Evidence") -> list[str]:
    """Return notes on failed components that were not replaced, and on a removal as failed without a cause.

    These notes are left out while a failure keeps the unit out of service, which the prognosis states. Notes
    on findings that contradict the diagnoses follow.
    """
    notes = [
        f"{' and '.join(failure.components)} found failed at {failure.hours:.9g} h, and no replacement is "
        "in the history: the unit still counts as in service, because another component was replaced, or it "
        "was flown or removed again; if it was not repaired, it has no remaining useful life"
        for failure in evidence.not_replaced
    ]
    removed = evidence.open_removal
    if removed is not None:
        notes.append(
            f"the unit was removed as failed at {removed.hours:.9g} h, and the shop's findings of these "
            f"hours name only {', '.join(removed.named)}, none as failed: the unit counts as in service; if "
            "another finding is expected, wait for it"
        )
    return [*notes, *evidence.contradictions]
