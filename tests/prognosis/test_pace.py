"""What the pace of a fleet's units says of when another fails, against formulas and units drawn anew."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import kstest, norm

from emaphm.actuator import Actuator
from emaphm.actuator.requirements import Requirement
from emaphm.arrays import Array
from emaphm.prognosis import Evidence, Observation, Requirements
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.from_fleet.fleet_pace import FLEET_PACE, FleetPaceModel
from emaphm.prognosis.from_fleet.forecast_by_fleet import mixed_with_pace
from emaphm.prognosis.from_fleet.pace_population import (
    PACE_POPULATION,
    PopulationDraws,
    general_covariance,
    remaining_hours,
    sampled_population,
)
from emaphm.prognosis.from_fleet.passages import LEAST_VARIANCE, SHARES, Passages
from emaphm.prognosis.metrics import Prediction, coverage, probability_integral_transform
from emaphm.prognosis.prior import NEW, Prior
from emaphm.prognosis.requirements.failure_times import FailureTimes
from emaphm.prognosis.stress import Stress, StressPiece, StressReference

LIMIT = 0.6
ACTUATOR = Actuator.thesis().model_copy(
    update={"requirements": (Requirement(component="friction", at_most=LIMIT),)}
)
LIMITS = Requirements(ACTUATOR).limits
FLAT = np.full(SHARES.size, 5.0)


def saturating(share_of_life: Array | float) -> Array:
    """Return the consumed share of the margin of a component that accelerates, then saturates: 1 at 1."""
    u = np.asarray(share_of_life)
    return np.asarray((np.sin(np.pi * np.clip(u, 0.0, 1.1) ** 1.5 - np.pi / 2) + 1) / 1.9)


def unit(life: float, number: int, upto: float = np.inf) -> Evidence:
    """Return a unit, diagnosed each 100 h up to its failure or `upto` [h]."""
    random = np.random.default_rng(number)
    fails = life * 0.9012
    observations = []
    for hours in np.arange(100.0, min(fails, upto), 100.0):
        level = NEW + 0.002 * random.standard_normal(8)
        level[0] += LIMIT * saturating(hours / life)
        observations.append(Observation(float(hours), level, 0.002**2 * np.eye(8), np.ones(8, bool)))
    return Evidence(
        f"U{number}",
        "part",
        observations[-1].hours,
        tuple(observations),
        failures=(fails,) if fails < upto else (),
    )


@cache
def fleet(count: int = 24) -> tuple[Evidence, ...]:
    """Return units of many lives, every third of which was removed half-way."""
    random = np.random.default_rng(0)
    lives = 2500.0 * np.exp(0.3 * random.standard_normal(count))
    return tuple(unit(life, i, 0.5 * life if i % 3 == 0 else np.inf) for i, life in enumerate(lives))


def of(units: Sequence[Evidence]) -> FleetPaceModel:
    return FleetPaceModel(units, NEW, None, np.zeros((8, 3)))


@cache
def usual() -> FleetPaceModel:
    """Return the model of the usual fleet, whose population is computed once."""
    return of(fleet())


def by_pace(by: FleetPaceModel, evidence: Evidence, times: Array, ahead: Stress | None = None) -> Array:
    new_at = np.full(8, max((hours for hours, _ in evidence.replacements), default=0.0))
    belief = replace(Belief.new(Prior()), hours=evidence.hours, new_at=new_at)
    return mixed_with_pace(
        FailureTimes(LIMITS, times), by, last_level(evidence, times), belief, evidence, ahead
    ).first


def passages(by: FleetPaceModel, evidence: Evidence) -> list[list[Passages]]:
    """Return what the lives of a unit show of each limit."""
    return [[Passages.of(*path) for path in lives] for lives in by.paths_of(evidence, LIMITS)]


def last_level(evidence: Evidence, times: Array) -> Array:
    """Return levels of each path of the `times`: those of the last diagnosis."""
    level = evidence.used[-1].level if evidence.used else NEW
    return np.tile(level, (times.shape[1], 1))


def one_class(mean: Array, covariance: Array, at_rest: float = 1e-6) -> PopulationDraws:
    """Return a population that is known, both of whose classes are alike."""
    shares = np.log([(1 - at_rest) / 2, (1 - at_rest) / 2, at_rest])
    return PopulationDraws(
        np.tile(mean, (1, 1, 2, 1)),
        np.tile(np.linalg.inv(covariance), (1, 1, 2, 1, 1)),
        shares[np.newaxis, np.newaxis],
        np.full((1, SHARES.size), 30),
    )


def test_passages_are_where_a_power_law_has_them() -> None:
    age = np.arange(20.0, 1601.0, 20.0)
    found = Passages.of(age, (age / 2000.0) ** 2)
    expected = np.diff(2000.0 * np.sqrt(SHARES), prepend=0.0)
    assert found.passed == 6
    assert np.exp(found.log_hours[:6]) == pytest.approx(expected[:6], rel=0.01)
    # Of the seventh step 40 % is done; the hours that it took say how long the whole step may take.
    assert found.part == pytest.approx(0.4, abs=1e-9)
    assert np.exp(found.log_hours[6]) == pytest.approx((1600 - 2000 * np.sqrt(0.6)) / 0.4, rel=0.01)
    assert 0 < found.precision[6] < found.precision[5]
    assert np.all(found.precision[7:] == 0)
    assert found.waited == -np.inf


def test_errors_of_diagnoses_make_no_passage() -> None:
    random = np.random.default_rng(0)
    found = Passages.of(np.arange(100.0, 3000.0, 100.0), 0.04 * random.standard_normal(29))
    assert found.passed == 0
    assert found.share < 0.1
    assert found.waited == pytest.approx(np.log(2900.0))


def test_the_last_step_given_those_before_is_that_of_the_normal_distribution() -> None:
    covariance = general_covariance()
    gone = FLAT[:9] + np.linspace(-0.3, 0.4, 9)
    at = np.cumsum(np.exp(gone))
    one = Passages.of(at, SHARES[:9])
    # What is known of a step has a variance of its own; then nothing of the last one is gone.
    errors = covariance[:9, :9] + LEAST_VARIANCE * np.eye(9)
    gain = np.linalg.solve(errors, covariance[:9, 9])
    mean, variance = 5.0 + gain @ (gone - 5.0), covariance[9, 9] - gain @ covariance[:9, 9]
    now = np.full(20_000, SHARES[8])
    hours = remaining_hours(one_class(FLAT, covariance), 0, one, now, np.random.default_rng(1))
    assert kstest((np.log(hours) - mean) / np.sqrt(variance), "norm").pvalue > 0.01


def test_a_component_that_waits_is_at_rest_as_probably_as_bayes_says() -> None:
    covariance, at_rest, waited = general_covariance(), 0.4, 240.0
    one = Passages.of(np.array([waited]), np.array([0.0]))
    hours = remaining_hours(
        one_class(FLAT, covariance, at_rest), 0, one, np.zeros(20_000), np.random.default_rng(2)
    )
    later = norm.sf((np.log(waited) - 5.0) / np.sqrt(covariance[0, 0])) / SHARES[0]
    resting = at_rest * norm.pdf(0.0, 0.0, PACE_POPULATION.resting_deviation)
    assert np.mean(np.isinf(hours)) == pytest.approx(resting / (resting + (1 - at_rest) * later), abs=0.01)
    assert np.all(hours > 0)


def test_what_is_learnt_has_the_mean_of_the_units_though_half_were_removed_early() -> None:
    random = np.random.default_rng(3)
    pace = 5.0 + 0.3 * random.standard_normal((200, 1))
    slowness = np.linspace(0.5, -0.5, SHARES.size) + pace + 0.1 * random.standard_normal((200, SHARES.size))
    # The slow ones are removed after some hours, when they have passed fewer steps.
    lives = []
    for each in np.cumsum(np.exp(slowness), axis=1):
        seen = each < 1200.0
        lives.append(Passages.of(each[seen], SHARES[seen]))
    population = sampled_population(Passages.stacked([Passages.stacked(lives)]), random)
    shares = np.exp(population.log_shares[:, 0, :2])
    mean = np.einsum("sk,skd->d", shares, population.mean[:, 0]) / shares.sum()
    assert mean == pytest.approx(np.linspace(5.5, 4.5, SHARES.size), abs=0.15)


def test_predictions_of_a_law_that_nobody_knows_hold_the_truth() -> None:
    by, random = usual(), np.random.default_rng(4)
    transforms, errors = [], []
    for i in range(40):
        life = 2500.0 * float(np.exp(0.3 * random.standard_normal()))
        until = life * 0.9012 * float(random.uniform(0.4, 0.8))
        one = replace(unit(life, 100 + i, until), failures=())
        true = life * 0.9012 - one.hours
        found = Prediction(one.hours, by_pace(by, one, np.full((1, 400), true)))
        transforms.append(probability_integral_transform(found, true))
        errors.append(found.median / true - 1)
    assert coverage(transforms) >= 0.85
    assert np.median(np.abs(errors)) < 0.1


def test_a_small_fleet_vague_diagnoses_and_failed_paths_leave_the_forecast_to_the_filter() -> None:
    one, times = unit(2500.0, 100, 1500.0), np.linspace(100.0, 900.0, 50)[np.newaxis]
    few = of(fleet(FLEET_PACE.fewest_units - 1))
    assert by_pace(few, one, times).tolist() == times[0].tolist()
    assert not by_pace(usual(), one, np.zeros((1, 50))).any()
    vague = [replace(each, covariance=0.1**2 * np.eye(8)) for each in one.observations]
    assert by_pace(usual(), replace(one, observations=tuple(vague)), times).tolist() == times[0].tolist()
    hidden = [replace(each, seen=np.zeros(8, bool)) for each in one.observations]
    assert by_pace(usual(), replace(one, observations=tuple(hidden)), times).tolist() == times[0].tolist()
    resting = [replace(each, observations=each.observations[:1], failures=()) for each in fleet()]
    assert by_pace(of(resting), one, times).tolist() == times[0].tolist()


def test_steps_that_fewer_than_four_lives_have_passed_leave_a_limit_to_the_filter() -> None:
    """Units removed half-way do not show how long the rest takes; four that failed do."""
    one, times = unit(2500.0, 100, 1300.0), np.linspace(100.0, 900.0, 50)[np.newaxis]
    working = [unit(2500.0 + 20.0 * i, i, 1200.0) for i in range(16)]
    for failed, is_known in (
        (0, False),
        (FLEET_PACE.fewest_passed - 1, False),
        (FLEET_PACE.fewest_passed, True),
    ):
        by = of([*(unit(2500.0 + 20.0 * i, i) for i in range(failed)), *working[failed:]])
        assert (by_pace(by, one, times).tolist() != times[0].tolist()) is is_known


def test_a_last_diagnosis_that_surprised_the_filter_leaves_the_forecast_to_it() -> None:
    one, times = unit(2500.0, 100, 1500.0), np.linspace(100.0, 900.0, 50)[np.newaxis]
    belief = replace(Belief.new(Prior()), hours=one.hours, surprise=0.9 * np.eye(8)[0])
    by = usual()
    level, filtered = last_level(one, times), FailureTimes(LIMITS, times)
    assert mixed_with_pace(filtered, by, level, belief, one, None).first.tolist() == times[0].tolist()
    other = replace(belief, surprise=0.9 * np.eye(8)[1])
    assert mixed_with_pace(filtered, by, level, other, one, None).first.tolist() != times[0].tolist()


def test_what_is_left_is_by_where_a_component_is_and_not_by_its_last_diagnosis() -> None:
    """One was seen at its limit, each step having taken 150 h: the consumed share may be 84 to 99 %."""
    one, now = Passages.of(150.0 * np.arange(1.0, 11.0), SHARES), np.linspace(0.84, 0.99, 50)
    population = one_class(np.full(SHARES.size, np.log(150.0)), 1e-4 * np.eye(SHARES.size))
    hours = remaining_hours(population, 0, one, now, np.random.default_rng(5))
    assert hours == pytest.approx(150.0 * (1 - now) / 0.1, rel=0.05)


def test_a_last_diagnosis_beyond_the_limit_fails_only_what_the_filter_says_has_failed() -> None:
    one = unit(2500.0, 100, 2200.0)
    beyond = replace(one.observations[-1], level=NEW + 1.01 * LIMIT * (np.arange(8) == 0))
    seen = replace(one, observations=(*one.observations[:-1], beyond))
    level = np.tile(NEW, (400, 1))
    level[:, 0] = LIMIT * np.linspace(0.9, 1.02, 400)
    times = np.where(level[:, 0] < LIMIT, 500.0, 0.0)[np.newaxis]
    belief = replace(Belief.new(Prior()), hours=one.hours)
    found = mixed_with_pace(FailureTimes(LIMITS, times), usual(), level, belief, seen, None).first
    assert np.array_equal(found == 0, times[0] == 0)
    # 16 of the 24 units have failed.
    assert np.mean(found[found > 0] != 500.0) == pytest.approx((16 / 24) ** 0.5 * 24 / 32, abs=0.01)


def test_the_pace_of_a_fleet_counts_as_far_as_its_units_have_failed() -> None:
    """As long as others still work, those that have passed the last steps are the fast ones."""
    one, times = unit(2500.0, 100, 1500.0), np.full((1, 400), 900.0)
    units = [unit(2000.0 + 20.0 * i, i) for i in range(24)]
    for failed in (6, 12, 24):
        fleet = [*units[:failed], *(replace(each, failures=()) for each in units[failed:])]
        share = np.mean(by_pace(of(fleet), one, times) != 900.0)
        assert share == pytest.approx((failed / 24) ** 0.5 * 24 / 32, abs=0.01)


def test_a_unit_that_survives_beyond_the_population_is_left_to_the_filter() -> None:
    by, times = usual(), np.full((1, 400), 900.0)
    seen = unit(2500.0, 100, 1800.0)
    assert np.mean(by_pace(by, replace(seen, hours=1900.0), times) != 900.0) == pytest.approx(0.61, abs=0.01)
    assert by_pace(by, replace(seen, hours=9000.0), times).tolist() == times[0].tolist()


def test_a_unit_passes_a_wider_limit_after_a_tighter_one_by_the_pace_too() -> None:
    one, by = unit(2500.0, 100, 1800.0), usual()
    bounds = (0.63, LIMIT)
    requirements = tuple(Requirement(component="friction", at_most=bound) for bound in bounds)
    limits = Requirements(ACTUATOR.model_copy(update={"requirements": requirements})).limits
    times, belief = np.full((2, 400), 2000.0), replace(Belief.new(Prior()), hours=one.hours)
    hours = mixed_with_pace(FailureTimes(limits, times), by, last_level(one, times), belief, one, None).hours
    assert np.all(hours[0] >= hours[1])
    alone = by_pace(by, one, times[1:])
    # Medians of samples of another population's draws, of the same fleet.
    assert np.median(hours.min(axis=0)) == pytest.approx(np.median(alone), rel=0.1)


def test_a_unit_that_has_passed_no_step_is_left_to_the_filter() -> None:
    times = np.linspace(1000.0, 3000.0, 50)[np.newaxis]
    for one in (Evidence("new", "part", 0.0), unit(2500.0, 100, 400.0)):
        assert by_pace(usual(), one, times).tolist() == times[0].tolist()


def test_a_replaced_component_has_a_life_of_its_own() -> None:
    by, times = usual(), np.full((1, 400), 2000.0)
    first, second = unit(2500.0, 100, 1800.0), unit(2500.0, 101, 1500.0)
    later = [replace(one, hours=one.hours + first.hours) for one in second.observations]
    both = replace(
        first,
        hours=first.hours + second.hours,
        observations=(*first.observations, *later),
        replacements=((first.hours, "friction"),),
    )
    alone, again = (float(np.median(by_pace(by, one, times))) for one in (second, both))
    assert again == pytest.approx(alone, rel=0.05)


def test_each_life_of_a_component_counts_for_the_pace_with_its_failure() -> None:
    first, second, by = unit(2500.0, 0), unit(3000.0, 1), of([])
    start = first.failures[0]
    later = [replace(one, hours=one.hours + start) for one in second.observations]
    both = replace(
        first,
        hours=start + second.failures[0],
        observations=(*first.observations, *later),
        replacements=((start, "friction"),),
        failures=(start, start + second.failures[0]),
    )
    ((of_first, of_second),) = passages(by, both)
    for found, alone in ((of_first, first), (of_second, second)):
        ((expected,),) = passages(by, alone)
        assert found.passed == SHARES.size
        assert found.log_hours == pytest.approx(expected.log_hours)


def test_units_of_which_one_component_had_more_lives_count_as_the_lives_do() -> None:
    """The classes of a component with one life in each unit do not depend on the other's second lives."""
    random = np.random.default_rng(6)
    lives = [
        Passages.of(np.cumsum(np.exp(5.0 + 0.3 * random.standard_normal(10))), SHARES) for _ in range(40)
    ]
    empty = Passages.of(np.zeros(0), np.zeros(0))
    both = Passages.stacked([Passages.stacked(lives), Passages.stacked([*lives[:10], *[empty] * 30])])
    present = np.array([[True] * 40, [True] * 10 + [False] * 30])
    shares = np.exp(sampled_population(both, random, present).log_shares).mean(axis=0)
    # Dirichlet (1, 1, ½) and all of n in the classes: n + 2 of n + 2.5.
    assert shares[:, 2] == pytest.approx([0.5 / 42.5, 0.5 / 12.5], abs=0.02)


def test_a_replacement_after_a_diagnosis_of_the_same_hours_says_nothing_of_then() -> None:
    by, times = usual(), np.full((1, 400), 2000.0)
    then = unit(2500.0, 100, 1800.0)
    belief = replace(Belief.new(Prior()), hours=then.hours)
    since = replace(then, replacements=((then.hours, "friction"),))
    one, other = (
        mixed_with_pace(FailureTimes(LIMITS, times), by, last_level(then, times), belief, each, None).first
        for each in (then, since)
    )
    assert np.array_equal(one, other)


@pytest.mark.parametrize("share", [0.5, 0.008, 1e-4])
def test_a_fleet_of_short_lives_lasts_as_much_shorter(share: float) -> None:
    """What fails after some 20 h, or after minutes, is foreseen as what fails after 2,500 h."""

    def shorter(one: Evidence) -> Evidence:
        seen = tuple(replace(each, hours=share * each.hours) for each in one.observations)
        failures = tuple(share * hours for hours in one.failures)
        return replace(one, hours=share * one.hours, observations=seen, failures=failures)

    one, times = unit(2500.0, 100, 1500.0), np.full((1, 400), 1e-9)
    slow = by_pace(usual(), one, times)
    fast = by_pace(of([shorter(each) for each in fleet()]), shorter(one), times)
    working = slow > 1.0
    assert np.median(slow[working]) > 300.0
    assert fast[working] == pytest.approx(share * slow[working], rel=1e-6)


def test_twice_the_pace_is_half_of_the_hours() -> None:
    reference = StressReference(temperature=300.0)
    exponents = np.zeros((8, 3))
    exponents[:, 1] = np.log(2.0)
    by = FleetPaceModel(fleet(), NEW, reference, exponents)
    one, times = unit(2500.0, 100, 1500.0), np.full((1, 400), 1e-3)
    nominal, hot = (by_pace(by, one, times, Stress(temperature=t)) for t in (300.0, 310.0))
    assert hot[hot > 1] == pytest.approx(nominal[nominal > 1] / 2)
    # A unit that has always been at 310 K has aged twice as far, and goes on so.
    warm = replace(one, stresses=(StressPiece(0.0, one.hours, Stress(temperature=310.0)),))
    assert np.median(by_pace(by, warm, times)) < np.median(by_pace(by, one, times)) * 1.3


def test_by_the_pace_of_the_fleet_too_a_stress_that_is_not_stated_stays_as_in_the_past() -> None:
    """A load without influence, at twice that of the past, leaves a warm unit its hours."""
    exponents = np.zeros((8, 3))
    exponents[:, 1] = np.log(2.0)
    by = FleetPaceModel(fleet(), NEW, StressReference(load=2.0, temperature=300.0), exponents)
    one, times = unit(2500.0, 100, 1500.0), np.full((1, 400), 1e-3)
    warm = replace(one, stresses=(StressPiece(0.0, one.hours, Stress(load=1.0, temperature=310.0)),))
    as_before = by_pace(by, warm, times)
    assert by_pace(by, warm, times, Stress(load=2.0)) == pytest.approx(as_before)
    cool = by_pace(by, warm, times, Stress(load=2.0, temperature=300.0))
    assert cool[cool > 1] == pytest.approx(2 * as_before[as_before > 1])
