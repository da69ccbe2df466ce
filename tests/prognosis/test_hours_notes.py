"""Notes on hours far from all others: of a shop's entry, or between recordings."""

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


def at(*hours: float) -> Evidence:
    seen = (Observation(one, NEW, 1e-4 * np.eye(8), np.ones(8, bool)) for one in hours)
    return Evidence("S1", "P1", hours[-1], tuple(seen))


def test_hours_that_jump_between_recordings_are_noted() -> None:
    (note,) = hours_notes(at(100.0, 200.0, 300.0, 49_800.0, 49_900.0, 50_000.0, 50_100.0))
    assert "no recording between 300 and 49800 h, 49500 of the 50000 h from the first" in note


@pytest.mark.parametrize(
    "hours",
    [
        (0.0, 10.0, 3000.0, 3100.0, 3200.0),  # two of an acceptance test
        (100.0, 200.0, 300.0, 9000.0, 9100.0),
        (100.0, 200.0, 300.0, 1500.0, 1600.0, 1700.0),  # three times the others
        (50.0, 50.0, 50.0, 50.0, 50.0, 50.0),
        (50.0,),
    ],
)
def test_other_gaps_between_recordings_make_no_note(hours: tuple[float, ...]) -> None:
    assert not hours_notes(at(*hours))
