"""What a prognosis notes of a newest diagnosis that it hardly follows."""

from dataclasses import replace

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.prognosis import Evidence, prognose
from emaphm.prognosis.notes.newest import newest_notes
from emaphm.prognosis.prior import NEW

from .diagnosed import at, diagnosed


def test_a_newest_diagnosis_that_is_left_out_is_said() -> None:
    before = diagnosed(lambda _: at(0.2))
    level = np.tile(NEW + at(0.2), (50, 1))
    assert newest_notes(before, level) == []
    shown = replace(before.observations[-1], hours=1010.0, level=NEW + at(0.72))
    apart = replace(before, hours=1010.0, observations=(*before.observations, shown))
    (note,) = newest_notes(apart, level)
    assert "the newest diagnosis, of 1010 h, has friction 0.72 (0.2)" in note
    # Once it is believed, or after a replacement that came later, there is nothing to say.
    assert newest_notes(apart, np.tile(NEW + at(0.72), (50, 1))) == []
    assert newest_notes(replace(apart, replacements=((1010.0, "friction"),)), level) == []
    # That of another component says nothing about it.
    assert newest_notes(replace(apart, replacements=((1010.0, "backlash"),)), level) != []


def noted(evidence: Evidence) -> list[str]:
    """Return what the prognosis of a unit says of its newest diagnosis."""
    notes = prognose(evidence, Actuator.thesis(), keep_past=False).notes
    return [one for one in notes if "newest" in one and " has " in one]


@pytest.mark.usefixtures("few_steps")
@pytest.mark.parametrize("seed", range(2))
def test_wear_that_went_on_since_the_newest_diagnosis_makes_it_no_outlier(seed: int) -> None:
    """Even wear by 4e-4 an hour, and 400 h more flown: 0.16, or some 25 standard errors."""
    worn = diagnosed(lambda hours: at(4e-4 * hours), seed=seed)
    assert noted(replace(worn, hours=1400.0)) == []
    odd = replace(worn.observations[-1], hours=1010.0, level=worn.observations[-1].level + at(0.4))
    for now in (1010.0, 1400.0):
        (note,) = noted(replace(worn, hours=now, observations=(*worn.observations, odd)))
        assert f"has friction {odd.level[0]:.3g}" in note


def test_an_eccentricity_is_said_by_its_magnitude_and_direction_and_only_the_newest_is_called_so() -> None:
    steady = diagnosed(lambda _: np.array([0, 0, 0, 0, 0, 0.0, 0.3, 0]))
    turned = np.tile(NEW + np.array([0, 0, 0, 0, 0, 0.4, 0.0, 0]), (50, 1))
    (note,) = newest_notes(steady, turned)
    assert "the newest diagnosis, of 1000 h, has eccentricity 0.29" in note
    assert note.index("at 90°") < note.index("(0.4 at 0°)")
    assert "eccentricity_" not in note
    unexplained = replace(steady.observations[-1], hours=1010.0, explained=False)
    (note,) = newest_notes(replace(steady, observations=(*steady.observations, unexplained)), turned)
    assert "the newest explained diagnosis, of 1000 h, has" in note
