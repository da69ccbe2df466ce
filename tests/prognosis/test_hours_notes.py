"""A note where only a shop's entry has a unit's hours, far from its last recording."""

from dataclasses import replace

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.prognosis import Evidence, Observation, prognose
from emaphm.prognosis.notes.hours import hours_notes
from emaphm.prognosis.prior import NEW

SEEN = Evidence(
    "S1",
    "P1",
    600.0,
    tuple(
        Observation(float(hours), NEW, 1e-4 * np.eye(8), np.ones(8, bool)) for hours in range(100, 700, 100)
    ),
)


@pytest.mark.parametrize("hours", [600.0, 650.0, 1100.0])
def test_a_shops_entry_soon_after_the_last_recording_makes_no_note(hours: float) -> None:
    assert not hours_notes(replace(SEEN, hours=hours))
    assert not hours_notes(Evidence("S1", "P1", hours))


@pytest.mark.usefixtures("few_paths")
def test_a_prognosis_says_that_its_hours_are_far_from_the_last_recording() -> None:
    far = replace(SEEN, hours=40_000.0, replacements=((40_000.0, "friction"),))
    (note,) = [note for note in prognose(far, Actuator.thesis()).notes if "last recording" in note]
    assert "of 600 h, but a removal or a finding has 40000 h" in note
