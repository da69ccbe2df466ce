"""Notes on a newest diagnosis that the filter regards as an outlier."""

from dataclasses import replace

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.prognosis import Evidence, prognose
from emaphm.prognosis.notes.newest import newest_notes
from emaphm.prognosis.prior import NEW

from .diagnosed import at, diagnosed


def test_a_newest_diagnosis_that_the_belief_does_not_follow_is_noted() -> None:
    before = diagnosed(lambda _: at(0.2))
    level = np.tile(NEW + at(0.2), (50, 1))
    assert newest_notes(before, level) == []
    outlier = replace(before.observations[-1], hours=1010.0, level=NEW + at(0.72))
    with_outlier = replace(before, hours=1010.0, observations=(*before.observations, outlier))
    (note,) = newest_notes(with_outlier, level)
    assert "the newest diagnosis, of 1010 h, has friction 0.72 (0.2)" in note
    # No note when the belief follows the diagnosis, or after a replacement since then.
    assert newest_notes(with_outlier, np.tile(NEW + at(0.72), (50, 1))) == []
    assert newest_notes(replace(with_outlier, replacements=((1010.0, "friction"),)), level) == []
    # The replacement of another component does not remove the note.
    assert newest_notes(replace(with_outlier, replacements=((1010.0, "backlash"),)), level) != []


def noted(evidence: Evidence) -> list[str]:
    """Return the notes on the newest diagnosis in the prognosis of a unit."""
    notes = prognose(evidence, Actuator.thesis(), keep_past=False).notes
    return [note for note in notes if "newest" in note and " has " in note]


@pytest.mark.usefixtures("few_steps")
@pytest.mark.parametrize("seed", range(2))
def test_wear_since_the_newest_diagnosis_does_not_make_it_an_outlier(seed: int) -> None:
    """Uniform wear of 4e-4 per hour over another 400 h is 0.16, about 25 standard errors."""
    worn = diagnosed(lambda hours: at(4e-4 * hours), seed=seed)
    assert noted(replace(worn, hours=1400.0)) == []
    outlier = replace(worn.observations[-1], hours=1010.0, level=worn.observations[-1].level + at(0.4))
    for now in (1010.0, 1400.0):
        (note,) = noted(replace(worn, hours=now, observations=(*worn.observations, outlier)))
        assert f"has friction {outlier.level[0]:.3g}" in note


def test_the_note_gives_magnitude_and_direction_and_names_the_newest_explained_diagnosis() -> None:
    steady = diagnosed(lambda _: np.array([0, 0, 0, 0, 0, 0.0, 0.3, 0]))
    turned = np.tile(NEW + np.array([0, 0, 0, 0, 0, 0.4, 0.0, 0]), (50, 1))
    (note,) = newest_notes(steady, turned)
    assert "the newest diagnosis, of 1000 h, has eccentricity 0.29" in note
    assert note.index("at 90°") < note.index("(0.4 at 0°)")
    assert "eccentricity_" not in note
    unexplained = replace(steady.observations[-1], hours=1010.0, explained=False)
    (note,) = newest_notes(replace(steady, observations=(*steady.observations, unexplained)), turned)
    assert "the newest explained diagnosis, of 1000 h, has" in note
