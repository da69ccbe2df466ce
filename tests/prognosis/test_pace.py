"""RUL from the pace of a fleet's units, against formulas and newly drawn units."""

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
    """Return the consumed share of a margin for wear that accelerates and then saturates; it is 1 at 1."""
    u = np.asarray(share_of_life)
    return np.asarray((np.sin(np.pi * np.clip(u, 0.0, 1.1) ** 1.5 - np.pi / 2) + 1) / 1.9)


def unit(life: float, number: int, upto: float = np.inf) -> Evidence:
    """Return a unit with a diagnosis every 100 h up to its failure or to `upto` [h]."""
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
    """Return units with scattered lives; every third unit was removed after half of its life."""
    random = np.random.default_rng(0)
    lives = 2500.0 * np.exp(0.3 * random.standard_normal(count))
    return tuple(unit(life, i, 0.5 * life if i % 3 == 0 else np.inf) for i, life in enumerate(lives))


def pace_model(units: Sequence[Evidence]) -> FleetPaceModel:
    return FleetPaceModel(units, NEW, None, np.zeros((8, 3)))


@cache
def usual_model() -> FleetPaceModel:
    """Return the model of the usual fleet; its population is computed only once."""
    return pace_model(fleet())


def by_pace(model: FleetPaceModel, evidence: Evidence, times: Array, ahead: Stress | None = None) -> Array:
    new_at = np.full(8, max((hours for hours, _ in evidence.replacements), default=0.0))
    belief = replace(Belief.new(Prior()), hours=evidence.hours, new_at=new_at)
    return mixed_with_pace(
        FailureTimes(LIMITS, times), model, last_level(evidence, times), belief, evidence, ahead
    ).first


def passages(model: FleetPaceModel, evidence: Evidence) -> list[list[Passages]]:
    """Return the passages in each life of a unit, for each limit."""
    return [[Passages.of(*course) for course in lives] for lives in model.paths_of(evidence, LIMITS)]


def last_level(evidence: Evidence, times: Array) -> Array:
    """Return the levels of the last diagnosis, repeated for each path of `times`."""
    level = evidence.used[-1].level if evidence.used else NEW
    return np.tile(level, (times.shape[1], 1))


def one_class(mean: Array, covariance: Array, at_rest: float = 1e-6) -> PopulationDraws:
    """Return a known population with two identical classes."""
    shares = np.log([(1 - at_rest) / 2, (1 - at_rest) / 2, at_rest])
    return PopulationDraws(
        np.tile(mean, (1, 1, 2, 1)),
        np.tile(np.linalg.inv(covariance), (1, 1, 2, 1, 1)),
        shares[np.newaxis, np.newaxis],
        np.full((1, SHARES.size), 30),
    )


def test_passages_of_a_power_law_agree_with_its_closed_form() -> None:
    age = np.arange(20.0, 1601.0, 20.0)
    passages_of_life = Passages.of(age, (age / 2000.0) ** 2)
    expected = np.diff(2000.0 * np.sqrt(SHARES), prepend=0.0)
    assert passages_of_life.passed == 6
    assert np.exp(passages_of_life.log_hours[:6]) == pytest.approx(expected[:6], rel=0.01)
    # 40 % of the seventh step is done; the hours so far give an estimate of the step's duration.
    assert passages_of_life.part == pytest.approx(0.4, abs=1e-9)
    assert np.exp(passages_of_life.log_hours[6]) == pytest.approx(
        (1600 - 2000 * np.sqrt(0.6)) / 0.4, rel=0.01
    )
    assert 0 < passages_of_life.precision[6] < passages_of_life.precision[5]
    assert np.all(passages_of_life.precision[7:] == 0)
    assert passages_of_life.waited == -np.inf


def test_errors_of_diagnoses_do_not_cause_passages() -> None:
    random = np.random.default_rng(0)
    passages_of_life = Passages.of(np.arange(100.0, 3000.0, 100.0), 0.04 * random.standard_normal(29))
    assert passages_of_life.passed == 0
    assert passages_of_life.share < 0.1
    assert passages_of_life.waited == pytest.approx(np.log(2900.0))


def test_the_last_step_has_the_conditional_normal_distribution_given_those_before() -> None:
    covariance = general_covariance()
    log_hours = FLAT[:9] + np.linspace(-0.3, 0.4, 9)
    passed_at = np.cumsum(np.exp(log_hours))
    life = Passages.of(passed_at, SHARES[:9])
    # Each observed step has an error variance; no part of the last step has passed yet.
    errors = covariance[:9, :9] + LEAST_VARIANCE * np.eye(9)
    gain = np.linalg.solve(errors, covariance[:9, 9])
    mean, variance = 5.0 + gain @ (log_hours - 5.0), covariance[9, 9] - gain @ covariance[:9, 9]
    now = np.full(20_000, SHARES[8])
    hours = remaining_hours(one_class(FLAT, covariance), 0, life, now, np.random.default_rng(1))
    assert kstest((np.log(hours) - mean) / np.sqrt(variance), "norm").pvalue > 0.01


def test_the_probability_that_a_waiting_component_is_at_rest_follows_bayes_rule() -> None:
    covariance, at_rest, waited = general_covariance(), 0.4, 240.0
    life = Passages.of(np.array([waited]), np.array([0.0]))
    hours = remaining_hours(
        one_class(FLAT, covariance, at_rest), 0, life, np.zeros(20_000), np.random.default_rng(2)
    )
    later = norm.sf((np.log(waited) - 5.0) / np.sqrt(covariance[0, 0])) / SHARES[0]
    resting = at_rest * norm.pdf(0.0, 0.0, PACE_POPULATION.resting_deviation)
    assert np.mean(np.isinf(hours)) == pytest.approx(resting / (resting + (1 - at_rest) * later), abs=0.01)
    assert np.all(hours > 0)


def test_the_population_mean_is_unbiased_although_half_of_the_units_are_censored() -> None:
    random = np.random.default_rng(3)
    pace = 5.0 + 0.3 * random.standard_normal((200, 1))
    slowness = np.linspace(0.5, -0.5, SHARES.size) + pace + 0.1 * random.standard_normal((200, SHARES.size))
    # All units are removed after 1,200 h, when slow units have passed fewer steps.
    lives = []
    for hours in np.cumsum(np.exp(slowness), axis=1):
        observed = hours < 1200.0
        lives.append(Passages.of(hours[observed], SHARES[observed]))
    population = sampled_population(Passages.stacked([Passages.stacked(lives)]), random)
    shares = np.exp(population.log_shares[:, 0, :2])
    mean = np.einsum("sk,skd->d", shares, population.mean[:, 0]) / shares.sum()
    assert mean == pytest.approx(np.linspace(5.5, 4.5, SHARES.size), abs=0.15)


def test_predictions_for_an_unknown_law_cover_the_true_rul() -> None:
    model, random = usual_model(), np.random.default_rng(4)
    transforms, errors = [], []
    for i in range(40):
        life = 2500.0 * float(np.exp(0.3 * random.standard_normal()))
        upto = life * 0.9012 * float(random.uniform(0.4, 0.8))
        evidence = replace(unit(life, 100 + i, upto), failures=())
        true = life * 0.9012 - evidence.hours
        predicted = Prediction(evidence.hours, by_pace(model, evidence, np.full((1, 400), true)))
        transforms.append(probability_integral_transform(predicted, true))
        errors.append(predicted.median / true - 1)
    assert coverage(transforms) >= 0.85
    assert np.median(np.abs(errors)) < 0.1


def test_small_fleets_uncertain_diagnoses_and_failed_paths_keep_the_filters_forecast() -> None:
    evidence, times = unit(2500.0, 100, 1500.0), np.linspace(100.0, 900.0, 50)[np.newaxis]
    few = pace_model(fleet(FLEET_PACE.fewest_units - 1))
    assert by_pace(few, evidence, times).tolist() == times[0].tolist()
    assert not by_pace(usual_model(), evidence, np.zeros((1, 50))).any()
    vague = [replace(observation, covariance=0.1**2 * np.eye(8)) for observation in evidence.observations]
    assert (
        by_pace(usual_model(), replace(evidence, observations=tuple(vague)), times).tolist()
        == times[0].tolist()
    )
    hidden = [replace(observation, seen=np.zeros(8, bool)) for observation in evidence.observations]
    assert (
        by_pace(usual_model(), replace(evidence, observations=tuple(hidden)), times).tolist()
        == times[0].tolist()
    )
    resting = [replace(each, observations=each.observations[:1], failures=()) for each in fleet()]
    assert by_pace(pace_model(resting), evidence, times).tolist() == times[0].tolist()


def test_steps_that_fewer_than_four_lives_have_passed_keep_the_filters_forecast() -> None:
    """Units removed after half of their lives do not identify the last steps; four failed units do."""
    evidence, times = unit(2500.0, 100, 1300.0), np.linspace(100.0, 900.0, 50)[np.newaxis]
    working = [unit(2500.0 + 20.0 * i, i, 1200.0) for i in range(16)]
    for failed, is_known in (
        (0, False),
        (FLEET_PACE.fewest_passed - 1, False),
        (FLEET_PACE.fewest_passed, True),
    ):
        model = pace_model([*(unit(2500.0 + 20.0 * i, i) for i in range(failed)), *working[failed:]])
        assert (by_pace(model, evidence, times).tolist() != times[0].tolist()) is is_known


def test_a_surprising_last_diagnosis_keeps_the_filters_forecast() -> None:
    evidence, times = unit(2500.0, 100, 1500.0), np.linspace(100.0, 900.0, 50)[np.newaxis]
    belief = replace(Belief.new(Prior()), hours=evidence.hours, surprise=0.9 * np.eye(8)[0])
    model = usual_model()
    level, filtered = last_level(evidence, times), FailureTimes(LIMITS, times)
    assert mixed_with_pace(filtered, model, level, belief, evidence, None).first.tolist() == times[0].tolist()
    surprise_elsewhere = replace(belief, surprise=0.9 * np.eye(8)[1])
    assert (
        mixed_with_pace(filtered, model, level, surprise_elsewhere, evidence, None).first.tolist()
        != times[0].tolist()
    )


def test_remaining_hours_follow_from_the_current_level_rather_than_the_last_diagnosis() -> None:
    """The last diagnosis is at the limit and each step took 150 h; the current share is 84 to 99 %."""
    life, now = Passages.of(150.0 * np.arange(1.0, 11.0), SHARES), np.linspace(0.84, 0.99, 50)
    population = one_class(np.full(SHARES.size, np.log(150.0)), 1e-4 * np.eye(SHARES.size))
    hours = remaining_hours(population, 0, life, now, np.random.default_rng(5))
    assert hours == pytest.approx(150.0 * (1 - now) / 0.1, rel=0.05)


def test_after_a_last_diagnosis_beyond_the_limit_only_the_filters_failed_paths_fail() -> None:
    evidence = unit(2500.0, 100, 2200.0)
    beyond = replace(evidence.observations[-1], level=NEW + 1.01 * LIMIT * (np.arange(8) == 0))
    with_last = replace(evidence, observations=(*evidence.observations[:-1], beyond))
    level = np.tile(NEW, (400, 1))
    level[:, 0] = LIMIT * np.linspace(0.9, 1.02, 400)
    times = np.where(level[:, 0] < LIMIT, 500.0, 0.0)[np.newaxis]
    belief = replace(Belief.new(Prior()), hours=evidence.hours)
    mixed = mixed_with_pace(FailureTimes(LIMITS, times), usual_model(), level, belief, with_last, None).first
    assert np.array_equal(mixed == 0, times[0] == 0)
    # 16 of the 24 units have failed.
    assert np.mean(mixed[mixed > 0] != 500.0) == pytest.approx((16 / 24) ** 0.5 * 24 / 32, abs=0.01)


def test_the_weight_of_the_fleets_pace_grows_with_its_share_of_failed_units() -> None:
    """While other units still work, the units that have passed the last steps are the fast ones."""
    evidence, times = unit(2500.0, 100, 1500.0), np.full((1, 400), 900.0)
    units = [unit(2000.0 + 20.0 * i, i) for i in range(24)]
    for failed in (6, 12, 24):
        fleet = [*units[:failed], *(replace(each, failures=()) for each in units[failed:])]
        share = np.mean(by_pace(pace_model(fleet), evidence, times) != 900.0)
        assert share == pytest.approx((failed / 24) ** 0.5 * 24 / 32, abs=0.01)


def test_a_unit_that_outlives_the_population_keeps_the_filters_forecast() -> None:
    model, times = usual_model(), np.full((1, 400), 900.0)
    evidence = unit(2500.0, 100, 1800.0)
    assert np.mean(by_pace(model, replace(evidence, hours=1900.0), times) != 900.0) == pytest.approx(
        0.61, abs=0.01
    )
    assert by_pace(model, replace(evidence, hours=9000.0), times).tolist() == times[0].tolist()


def test_the_pace_model_reaches_a_wider_limit_after_a_tighter_one() -> None:
    evidence, model = unit(2500.0, 100, 1800.0), usual_model()
    bounds = (0.63, LIMIT)
    requirements = tuple(Requirement(component="friction", at_most=bound) for bound in bounds)
    limits = Requirements(ACTUATOR.model_copy(update={"requirements": requirements})).limits
    times, belief = np.full((2, 400), 2000.0), replace(Belief.new(Prior()), hours=evidence.hours)
    hours = mixed_with_pace(
        FailureTimes(limits, times), model, last_level(evidence, times), belief, evidence, None
    ).hours
    assert np.all(hours[0] >= hours[1])
    alone = by_pace(model, evidence, times[1:])
    # The medians are of samples from two populations, drawn for the same fleet.
    assert np.median(hours.min(axis=0)) == pytest.approx(np.median(alone), rel=0.1)


def test_a_unit_that_has_passed_no_step_keeps_the_filters_forecast() -> None:
    times = np.linspace(1000.0, 3000.0, 50)[np.newaxis]
    for evidence in (Evidence("new", "part", 0.0), unit(2500.0, 100, 400.0)):
        assert by_pace(usual_model(), evidence, times).tolist() == times[0].tolist()


def test_a_replaced_component_is_predicted_like_that_of_a_new_unit() -> None:
    model, times = usual_model(), np.full((1, 400), 2000.0)
    first, second = unit(2500.0, 100, 1800.0), unit(2500.0, 101, 1500.0)
    later = [replace(each, hours=each.hours + first.hours) for each in second.observations]
    both = replace(
        first,
        hours=first.hours + second.hours,
        observations=(*first.observations, *later),
        replacements=((first.hours, "friction"),),
    )
    alone, again = (float(np.median(by_pace(model, each, times))) for each in (second, both))
    assert again == pytest.approx(alone, rel=0.05)


def test_each_life_of_a_component_gives_the_passages_up_to_its_failure() -> None:
    first, second, model = unit(2500.0, 0), unit(3000.0, 1), pace_model([])
    start = first.failures[0]
    later = [replace(observation, hours=observation.hours + start) for observation in second.observations]
    both = replace(
        first,
        hours=start + second.failures[0],
        observations=(*first.observations, *later),
        replacements=((start, "friction"),),
        failures=(start, start + second.failures[0]),
    )
    ((of_first, of_second),) = passages(model, both)
    for passages_of_life, alone in ((of_first, first), (of_second, second)):
        ((expected,),) = passages(model, alone)
        assert passages_of_life.passed == SHARES.size
        assert passages_of_life.log_hours == pytest.approx(expected.log_hours)


def test_class_shares_of_a_component_follow_from_its_own_number_of_lives() -> None:
    """The classes of a component with one life per unit do not depend on another's second lives."""
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


def test_a_replacement_at_the_hours_of_a_diagnosis_does_not_affect_the_forecast_from_then() -> None:
    model, times = usual_model(), np.full((1, 400), 2000.0)
    then = unit(2500.0, 100, 1800.0)
    belief = replace(Belief.new(Prior()), hours=then.hours)
    since = replace(then, replacements=((then.hours, "friction"),))
    without_replacement, with_replacement = (
        mixed_with_pace(
            FailureTimes(LIMITS, times), model, last_level(then, times), belief, evidence, None
        ).first
        for evidence in (then, since)
    )
    assert np.array_equal(without_replacement, with_replacement)


@pytest.mark.parametrize("share", [0.5, 0.008, 1e-4])
def test_predictions_scale_with_the_lives_of_the_fleet(share: float) -> None:
    """Failures after about 20 h, or after minutes, are predicted like failures after 2,500 h."""

    def shorter(long: Evidence) -> Evidence:
        observations = tuple(replace(each, hours=share * each.hours) for each in long.observations)
        failures = tuple(share * hours for hours in long.failures)
        return replace(long, hours=share * long.hours, observations=observations, failures=failures)

    evidence, times = unit(2500.0, 100, 1500.0), np.full((1, 400), 1e-9)
    slow = by_pace(usual_model(), evidence, times)
    fast = by_pace(pace_model([shorter(each) for each in fleet()]), shorter(evidence), times)
    working = slow > 1.0
    assert np.median(slow[working]) > 300.0
    assert fast[working] == pytest.approx(share * slow[working], rel=1e-6)


def test_twice_the_pace_halves_the_remaining_hours() -> None:
    reference = StressReference(temperature=300.0)
    exponents = np.zeros((8, 3))
    exponents[:, 1] = np.log(2.0)
    model = FleetPaceModel(fleet(), NEW, reference, exponents)
    evidence, times = unit(2500.0, 100, 1500.0), np.full((1, 400), 1e-3)
    nominal, hot = (by_pace(model, evidence, times, Stress(temperature=t)) for t in (300.0, 310.0))
    assert hot[hot > 1] == pytest.approx(nominal[nominal > 1] / 2)
    # A unit that has always been at 310 K has aged twice as much, and continues at that pace.
    warm = replace(evidence, stresses=(StressPiece(0.0, evidence.hours, Stress(temperature=310.0)),))
    assert np.median(by_pace(model, warm, times)) < np.median(by_pace(model, evidence, times)) * 1.3


def test_the_pace_model_keeps_a_future_stress_that_is_not_stated_as_in_the_past() -> None:
    """A load without influence, twice the past load, does not change a warm unit's remaining hours."""
    exponents = np.zeros((8, 3))
    exponents[:, 1] = np.log(2.0)
    model = FleetPaceModel(fleet(), NEW, StressReference(load=2.0, temperature=300.0), exponents)
    evidence, times = unit(2500.0, 100, 1500.0), np.full((1, 400), 1e-3)
    warm = replace(
        evidence, stresses=(StressPiece(0.0, evidence.hours, Stress(load=1.0, temperature=310.0)),)
    )
    as_before = by_pace(model, warm, times)
    assert by_pace(model, warm, times, Stress(load=2.0)) == pytest.approx(as_before)
    cool = by_pace(model, warm, times, Stress(load=2.0, temperature=300.0))
    assert cool[cool > 1] == pytest.approx(2 * as_before[as_before > 1])
