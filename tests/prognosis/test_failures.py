"""Failures of fleet units that were judged by other requirements than those of the prognosis."""

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


def limited_friction(at_most: float) -> Actuator:
    """Return the thesis's actuator with an upper limit of its friction."""
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


def test_a_unit_that_flew_on_beyond_a_limit_passed_it_when_its_level_reached_it() -> None:
    """The unit failed at 0.8; it passed 0.4 at 1,600 h, with a standard error of 40 h from a diagnosis."""
    unit, limits = worn(3200.0), Requirements(limited_friction(0.4)).limits
    assert passed_at(unit.used, limits) == pytest.approx(1600.0, abs=3 * ERROR / RATE)
    chosen = record._predicted_observations(unit, limits)
    assert set(chosen.values()) == {passed_at(unit.used, limits)}
    assert unit.used[max(chosen)].hours == pytest.approx(1600.0, abs=150.0)


@pytest.mark.parametrize("at_most", [0.79, 0.8, 1.0])
def test_a_unit_that_failed_at_a_limit_has_the_hours_of_its_failure(at_most: float) -> None:
    """A limit within three standard errors of the last diagnosis does not count as passed before."""
    unit, limits = worn(3200.0), Requirements(limited_friction(at_most)).limits
    assert passed_at(unit.used, limits) == np.inf
    assert set(record._predicted_observations(unit, limits).values()) == {3200.0}


def test_a_component_without_an_estimate_passes_no_limit() -> None:
    hidden = Observation(100.0, NEW + 0.9, ERROR**2 * np.eye(8), np.zeros(8, bool))
    assert passed_at([hidden], Requirements(limited_friction(0.4)).limits) == np.inf


def test_failures_far_below_the_limits_are_noted() -> None:
    fleet = [worn(1600.0, seed) for seed in range(5)]
    (note,) = failure_notes(fleet, Requirements(limited_friction(0.8)).limits)
    assert "of 5 failures of other units 5 came with no level beyond 60 % of the way" in note
    for at_most in (0.2, 0.4):
        assert not failure_notes(fleet, Requirements(limited_friction(at_most)).limits)
    # One of eleven units may have had a jump, or another failure mode.
    many = [*(worn(3200.0, seed) for seed in range(10)), fleet[0]]
    assert not failure_notes(many, Requirements(limited_friction(0.8)).limits)
    measure = Requirement(measure="free_play", at_most=1e-3)
    actuator = Actuator.thesis().model_copy(update={"requirements": (measure,)})
    assert not failure_notes(fleet, Requirements(actuator).limits)


@pytest.mark.usefixtures("few_steps")
def test_a_prognosis_notes_that_the_failures_of_its_fleet_were_far_below_the_limits() -> None:
    each = [worn(1600.0, seed) for seed in range(3)]
    fleet = [replace(unit, observations=unit.observations[2::3]) for unit in each]
    new = Evidence("new", "part", 800.0, worn(900.0, 9).observations)
    notes = prognose(new, limited_friction(0.8), prior=fleet_prior(fleet), keep_past=False).notes
    assert any("of 3 failures of other units 3" in note for note in notes)
