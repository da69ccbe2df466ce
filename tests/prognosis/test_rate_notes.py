"""Notes on levels that change faster than a forecast can follow, as with hours entered in thousands."""

from dataclasses import replace

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.prognosis import Evidence, Observation, prognose
from emaphm.prognosis.notes.rates import rate_notes
from emaphm.prognosis.prior import NEW

ERROR = 0.005


def worn(rate: float, *, every: float, count: int = 10, jump: float = 0.0, seed: int = 0) -> Evidence:
    """Return a unit whose friction rises by `rate` per hour, and by `jump` at half of the diagnoses."""
    random = np.random.default_rng(seed)
    observations = []
    for i in range(1, count + 1):
        level = NEW + ERROR * random.standard_normal(8)
        level[0] += rate * every * i + jump * (i > count / 2)
        observations.append(Observation(every * i, level, ERROR**2 * np.eye(8), np.ones(8, bool)))
    return Evidence("S1", "P1", every * count, tuple(observations))


def test_hours_entered_in_thousands_are_noted() -> None:
    """Friction rises by 0.02 per hour, which is entered as 0.001 h: a rate of 20 per hour."""
    (note,) = rate_notes(worn(20.0, every=1e-3))
    assert note.startswith("levels change faster than this forecast can follow, 0.05 per hour: friction by ")
    assert float(note.partition("friction by ")[2].partition(";")[0]) == pytest.approx(20.0, rel=0.1)
    assert "check the unit of the hours" in note


@pytest.mark.usefixtures("few_steps")
def test_a_prognosis_contains_the_note_and_advises_to_inspect_now() -> None:
    """The forecast has failures hundreds of hours later than the diagnoses show."""
    prognosis = prognose(worn(20.0, every=1e-3), Actuator.thesis(), keep_past=False)
    assert any("faster than this forecast can follow" in note for note in prognosis.notes)
    assert (prognosis.advice.action, prognosis.advice.hours) == ("inspect by", 0.0)
    assert "check the unit of the hours" in prognosis.advice.reason


@pytest.mark.parametrize("seed", range(20))
def test_noise_jumps_and_rates_that_a_forecast_can_follow_are_not_noted(seed: int) -> None:
    assert rate_notes(worn(0.0, every=1e-3, seed=seed)) == []  # ten recordings in one flight
    assert rate_notes(worn(0.03, every=1.0, seed=seed)) == []
    assert rate_notes(worn(0.0, every=0.5, jump=0.6, seed=seed)) == []
    assert rate_notes(worn(20.0, every=1e-3, count=2, seed=seed)) == []


def test_diagnoses_before_a_replacement_are_not_noted() -> None:
    fast = worn(20.0, every=1e-3)
    assert rate_notes(replace(fast, replacements=((fast.hours, "friction"),))) == []
