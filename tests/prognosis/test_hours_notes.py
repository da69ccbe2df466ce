"""Notes on implausible flight hours: of a shop entry, or a gap between recordings."""

from dataclasses import replace

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.prognosis import Evidence, Observation, prognose
from emaphm.prognosis.notes.hours import hours_notes
from emaphm.prognosis.prior import NEW

DIAGNOSED = Evidence(
    "S1",
    "P1",
    600.0,
    tuple(
        Observation(float(hours), NEW, 1e-4 * np.eye(8), np.ones(8, bool)) for hours in range(100, 700, 100)
    ),
)


@pytest.mark.parametrize("hours", [600.0, 650.0, 1100.0])
def test_a_shop_entry_soon_after_the_last_recording_is_not_noted(hours: float) -> None:
    assert not hours_notes(replace(DIAGNOSED, hours=hours))
    assert not hours_notes(Evidence("S1", "P1", hours))


@pytest.mark.usefixtures("few_paths")
def test_a_prognosis_notes_hours_far_beyond_the_last_recording() -> None:
    far = replace(DIAGNOSED, hours=40_000.0, replacements=((40_000.0, "friction"),))
    (note,) = [note for note in prognose(far, Actuator.thesis()).notes if "last recording" in note]
    assert "of 600 h, but a removal or a finding has 40000 h" in note


def diagnosed_at(*hours: float) -> Evidence:
    observations = (
        Observation(recorded_at, NEW, 1e-4 * np.eye(8), np.ones(8, bool)) for recorded_at in hours
    )
    return Evidence("S1", "P1", hours[-1], tuple(observations))


def test_a_jump_of_the_hours_between_recordings_is_noted() -> None:
    (note,) = hours_notes(diagnosed_at(100.0, 200.0, 300.0, 49_800.0, 49_900.0, 50_000.0, 50_100.0))
    assert "no recording between 300 and 49800 h, 49500 of the 50000 h from the first" in note


@pytest.mark.parametrize(
    "hours",
    [
        (0.0, 10.0, 3000.0, 3100.0, 3200.0),  # two recordings of an acceptance test
        (100.0, 200.0, 300.0, 9000.0, 9100.0),
        (100.0, 200.0, 300.0, 1500.0, 1600.0, 1700.0),  # three times the median gap
        (50.0, 50.0, 50.0, 50.0, 50.0, 50.0),
        (50.0,),
    ],
)
def test_usual_gaps_between_recordings_are_not_noted(hours: tuple[float, ...]) -> None:
    assert not hours_notes(diagnosed_at(*hours))
