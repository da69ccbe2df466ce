"""Notes on failures without a recorded repair, for a unit that counts as in service."""

import pytest

from emaphm.actuator import Actuator
from emaphm.history import Finding, Flight, Removal
from emaphm.history.lives import Failure, OpenRemoval, not_replaced, open_removal
from emaphm.prognosis import Evidence, prognose
from emaphm.prognosis.notes.repairs import repair_notes

BACKLASH = Finding(400.0, "backlash", "failed")
FRICTION = Finding(400.0, "friction", "degraded", replaced=True)
FAILED = Removal(400.0, "failed")


@pytest.mark.parametrize(
    ("findings", "left"),
    [
        ([BACKLASH, FRICTION], ("backlash",)),
        ([BACKLASH, Finding(300.0, "backlash", "degraded", replaced=True)], ("backlash",)),
        ([BACKLASH, Finding(500.0, "backlash", "degraded", replaced=True)], None),
        ([BACKLASH, Finding(400.0, "unit", "degraded", replaced=True)], None),
        ([Finding(400.0, "backlash", "failed", replaced=True)], None),
        ([Finding(400.0, "unit", "failed"), FRICTION], None),
    ],
)
def test_a_failed_component_is_open_until_it_is_replaced(
    findings: list[Finding], left: tuple[str, ...] | None
) -> None:
    assert not_replaced(findings) == (() if left is None else (Failure(400.0, left),))


@pytest.mark.parametrize(
    ("flown", "removals", "findings", "is_open"),
    [
        (400.0, [FAILED], [Finding(400.0, "gain", "healthy")], True),
        (400.0, [FAILED], [], False),
        (400.0, [FAILED], [Finding(300.0, "gain", "healthy")], False),
        (400.0, [FAILED], [Finding(400.0, "unit", "healthy")], False),
        (400.0, [FAILED], [FRICTION], False),
        (400.0, [FAILED], [Finding(400.0, "gain", "healthy"), BACKLASH], False),
        (450.0, [FAILED], [Finding(400.0, "gain", "healthy")], False),
        (400.0, [Removal(400.0, "suspected")], [Finding(400.0, "gain", "healthy")], False),
        (400.0, [FAILED, Removal(500.0, "scheduled")], [Finding(400.0, "gain", "healthy")], False),
    ],
)
def test_a_removal_as_failed_is_open_while_all_findings_are_of_components_that_work(
    flown: float, removals: list[Removal], findings: list[Finding], is_open: bool
) -> None:
    expected = OpenRemoval(400.0, ("gain",)) if is_open else None
    assert open_removal([Flight(flown, None, None)], removals, findings) == expected


@pytest.mark.usefixtures("few_paths")
def test_the_first_note_of_a_prognosis_names_the_open_failure() -> None:
    assert not repair_notes(Evidence("S1", "P1", 400.0))
    left = Evidence("S1", "P1", 400.0, not_replaced=(Failure(400.0, ("backlash",)),))
    note = prognose(left, Actuator.thesis()).notes[0]
    assert note.startswith("backlash found failed at 400 h, and no replacement is in the history")
    (note,) = repair_notes(Evidence("S1", "P1", 400.0, open_removal=OpenRemoval(400.0, ("gain",))))
    assert "removed as failed at 400 h" in note
    assert "name only gain, none as failed" in note
