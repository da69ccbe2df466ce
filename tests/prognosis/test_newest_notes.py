"""What a prognosis notes of a newest diagnosis that it hardly follows."""

from dataclasses import replace

import numpy as np

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
    assert "the newest diagnosis, of 1010 h, shows friction 0.72 (0.2)" in note
    # Once it is believed, or after a replacement that came later, there is nothing to say.
    assert newest_notes(apart, np.tile(NEW + at(0.72), (50, 1))) == []
    assert newest_notes(replace(apart, replacements=((1010.0, "friction"),)), level) == []
