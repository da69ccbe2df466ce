"""Failures of the fleet by other requirements than those that are asked."""

from dataclasses import replace

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.actuator.requirements import Requirement
from emaphm.prognosis import Evidence, Observation, fleet_prior, prognose
from emaphm.prognosis.from_fleet import record
from emaphm.prognosis.from_fleet.failures import passed_at
from emaphm.prognosis.notes.failures import failure_notes
from emaphm.prognosis.prior import NEW
from emaphm.prognosis.requirements import Requirements

ERROR, RATE = 0.01, 1 / 4000


def asked(at_most: float) -> Actuator:
    """Return the thesis's actuator with a limit of its friction."""
    requirement = Requirement(component="friction", at_most=at_most)
    return Actuator.thesis().model_copy(update={"requirements": (requirement,)})


def worn(failed_at: float, seed: int = 0) -> Evidence:
    """Return a unit whose friction grew by `RATE` an hour, diagnosed each 100 h until it failed."""
    random = np.random.default_rng(seed)
    observations = []
    for hours in np.arange(100.0, failed_at, 100.0):
        level = NEW + ERROR * random.standard_normal(8)
        level[0] += RATE * hours
        observations.append(Observation(float(hours), level, ERROR**2 * np.eye(8), np.ones(8, bool)))
    return Evidence(f"unit {seed}", "part", failed_at, tuple(observations), failures=(failed_at,))


def test_a_unit_that_went_on_beyond_a_limit_passed_it_when_its_wear_did() -> None:
    """Failed at 0.8; 0.4 was passed at 1,600 h, known to the error of a diagnosis: 40 h."""
    unit, limits = worn(3200.0), Requirements(asked(0.4)).limits
    assert passed_at(unit.used, limits) == pytest.approx(1600.0, abs=3 * ERROR / RATE)
    chosen = record._predicted_observations(unit, limits)
    assert set(chosen.values()) == {passed_at(unit.used, limits)}
    assert unit.used[max(chosen)].hours == pytest.approx(1600.0, abs=150.0)


@pytest.mark.parametrize("at_most", [0.79, 0.8, 1.0])
def test_a_unit_that_failed_by_a_limit_failed_when_it_did(at_most: float) -> None:
    """Within three standard errors of its last diagnosis, nothing says that it went on beyond a limit."""
    unit, limits = worn(3200.0), Requirements(asked(at_most)).limits
    assert passed_at(unit.used, limits) == np.inf
    assert set(record._predicted_observations(unit, limits).values()) == {3200.0}


def test_a_component_that_no_diagnosis_saw_passed_nothing() -> None:
    hidden = Observation(100.0, NEW + 0.9, ERROR**2 * np.eye(8), np.zeros(8, bool))
    assert passed_at([hidden], Requirements(asked(0.4)).limits) == np.inf


def test_failures_far_below_the_limits_are_noted() -> None:
    fleet = [worn(1600.0, seed) for seed in range(5)]
    (note,) = failure_notes(fleet, Requirements(asked(0.8)).limits)
    assert "of 5 failures of other units 5 came with no level beyond 60 % of the way" in note
    for at_most in (0.2, 0.4):
        assert not failure_notes(fleet, Requirements(asked(at_most)).limits)
    # One of eleven may have jumped, or failed by something else.
    many = [*(worn(3200.0, seed) for seed in range(10)), fleet[0]]
    assert not failure_notes(many, Requirements(asked(0.8)).limits)
    measure = Requirement(measure="free_play", at_most=1e-3)
    actuator = Actuator.thesis().model_copy(update={"requirements": (measure,)})
    assert not failure_notes(fleet, Requirements(actuator).limits)


@pytest.mark.usefixtures("few_steps")
def test_a_prognosis_by_such_a_fleet_says_so() -> None:
    each = [worn(1600.0, seed) for seed in range(3)]
    fleet = [replace(one, observations=one.observations[2::3]) for one in each]
    new = Evidence("new", "part", 800.0, worn(900.0, 9).observations)
    notes = prognose(new, asked(0.8), prior=fleet_prior(fleet), keep_past=False).notes
    assert any("of 3 failures of other units 3" in note for note in notes)
