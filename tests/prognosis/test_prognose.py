"""Prognoses of units with a known time of failure, their notes, and the effect of a fleet's prior."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from emaphm.actuator import COMPONENTS, Actuator
from emaphm.actuator.requirements import Requirement
from emaphm.arrays import Array
from emaphm.errors import PrognosisError
from emaphm.prognosis import Evidence, Observation, Question, fleet_prior, prognose
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.forecast import Paths, drawn_states, paths
from emaphm.prognosis.metrics import Prediction, probability_integral_transform
from emaphm.prognosis.prior import NEW, Prior
from emaphm.prognosis.requirements import Requirements, failure_levels, vectors_of
from emaphm.prognosis.requirements.failure_times import failure_times, responsible
from emaphm.prognosis.settings import DegradationSettings, ForecastSettings
from emaphm.prognosis.wording.tables import level_table

ERROR = 0.01
EVERYTHING = np.ones(8, bool)
THESIS = Actuator.thesis()


def requiring(*requirements: Requirement) -> Actuator:
    return THESIS.model_copy(update={"requirements": requirements})


WORN = requiring(
    Requirement(component="friction", at_most=0.6), Requirement(component="eccentricity", at_most=0.5)
)


def observation(hours: float, *, seed: int = 0, explained: bool = True, **levels: float) -> Observation:
    level = NEW + ERROR * np.random.default_rng([seed, int(hours)]).standard_normal(8)
    level[0] += levels.get("friction", 0.0)
    level[5] += levels.get("x", 0.0)
    level[6] += levels.get("y", 0.0)
    return Observation(hours, level, ERROR**2 * np.eye(8), EVERYTHING, explained)


def wearing(
    count: int,
    *,
    rate: float = 2e-4,
    unit: str = "S1",
    seed: int = 0,
    start: float = 0.0,
    every: float = 50.0,
) -> Evidence:
    """Return a unit whose friction rises linearly, with `count` diagnoses at intervals of `every` [h]."""
    observations = tuple(
        observation(every * i, seed=seed, friction=start + rate * every * i) for i in range(1, count + 1)
    )
    return Evidence(unit, "P1", every * count, observations)


@pytest.mark.parametrize("seed", range(2))
def test_fast_wear_within_a_day_is_followed_with_any_seed(seed: int) -> None:
    # Few of a thousand draws of the rate are as fast as 0.04 per hour, which reaches the limit at 15 h.
    prognosis = prognose(
        wearing(6, rate=0.04, every=2.0, seed=seed), WORN, Question(100.0), seed=seed, keep_past=False
    )
    assert prognosis.interval90[0] < 15 - 12 + 2
    assert prognosis.median < 15


@pytest.mark.usefixtures("few_paths")
def test_linear_wear_is_extrapolated_to_its_limit() -> None:
    prognosis = prognose(wearing(10, every=200.0), WORN)
    true = 0.6 / 2e-4 - 2000
    assert prognosis.median == pytest.approx(true, rel=0.15)
    low, high = prognosis.interval90
    assert low < true < high
    assert (prognosis.component, prognosis.limit and prognosis.limit.label) == (
        "friction",
        "friction at most 0.6",
    )
    assert prognosis.advice.action in {"replace before", "inspect by"}


@pytest.mark.usefixtures("few_steps")
def test_a_growing_eccentricity_is_extrapolated_along_its_direction() -> None:
    observations = tuple(observation(250.0 * i, x=0.05 * i * 0.6, y=0.05 * i * 0.8) for i in range(1, 7))
    prognosis = prognose(Evidence("S1", "P1", 1500.0, observations), WORN)
    assert prognosis.component == "eccentricity"
    assert prognosis.median == pytest.approx(1000.0, rel=0.25)
    assert prognosis.levels()["eccentricity"]["median"] == pytest.approx(0.3, abs=0.02)


@pytest.mark.usefixtures("few_steps")
def test_a_violated_requirement_leaves_no_remaining_life() -> None:
    prognosis = prognose(wearing(4, start=0.7), WORN)
    assert prognosis.to_dict()["rul_hours"] == {"median": 0.0, "interval90": [0.0, 0.0]}
    assert prognosis.probability_of_failure == 1
    assert "violated already: friction at most 0.6" in prognosis.notes
    assert prognosis.advice.action == "replace before"
    # The level that a requirement limits has one value and one interval in all parts of the answer.
    required, level = prognosis.requirements()["friction at most 0.6"], prognosis.levels()["friction"]
    assert (required["value"], required["interval90"]) == (level["median"], level["interval90"])


def test_a_requirement_that_a_new_actuator_violates_is_refused() -> None:
    wrong = requiring(Requirement(measure="tracking_error", at_most=4e-4))
    with pytest.raises(PrognosisError, match=r"a new actuator .* violates .*tracking_error at most"):
        prognose(wearing(3), wrong)


@pytest.mark.usefixtures("few_steps")
def test_a_requirement_that_no_fault_can_violate_is_noted() -> None:
    prognosis = prognose(wearing(3), requiring(Requirement(measure="free_play", at_most=1.0)))
    assert math.isinf(prognosis.median)
    assert "no single fault at the end of its scale violates: free_play at most 1 rad" in prognosis.notes


@pytest.mark.usefixtures("few_steps")
def test_a_level_does_not_fall_below_the_end_of_its_scale() -> None:
    """The prognosis agrees with `failure_levels` for a healthy unit whose diagnoses scatter about 0."""
    prognosis = prognose(wearing(3, rate=0.0), requiring(Requirement(component="backlash", at_least=0.0)))
    assert math.isinf(prognosis.median)
    assert prognosis.probability_of_failure == 0
    assert "no single fault at the end of its scale violates: backlash at least 0" in prognosis.notes


@pytest.mark.usefixtures("few_steps")
def test_friction_may_violate_a_limit_at_the_friction_of_a_new_unit() -> None:
    """`failure_levels` agrees: friction is the only such component that may fall below healthy."""
    actuator = requiring(Requirement(component="friction", at_least=0.0))
    prognosis = prognose(wearing(3, rate=0.0, start=-0.2), actuator)
    assert prognosis.probability_of_failure == 1
    assert failure_levels(actuator)[0].levels["friction"] == (None, 0.0)


@pytest.mark.usefixtures("few_steps")
def test_friction_below_that_of_a_new_unit_does_not_shorten_the_rul() -> None:
    worn_in, new = (prognose(wearing(5, rate=0.0, start=start, every=100.0), WORN) for start in (-0.1, 0.0))
    assert worn_in.levels()["friction"]["median"] == pytest.approx(-0.1, abs=ERROR)
    label = worn_in.times.limits[0].label
    assert worn_in.probabilities()[label] <= new.probabilities()[label] + 0.01
    assert worn_in.median >= 0.8 * new.median


@pytest.mark.usefixtures("few_steps")
def test_a_falling_friction_is_extrapolated_to_its_lower_limit() -> None:
    lost_preload = requiring(Requirement(component="friction", at_least=-0.3))
    prognosis = prognose(wearing(5, rate=-2e-4, every=200.0), lost_preload)
    assert prognosis.component == "friction"
    assert prognosis.median == pytest.approx(0.3 / 2e-4 - prognosis.evidence.hours, rel=0.15)


@pytest.mark.usefixtures("few_steps")
def test_an_unexplained_diagnosis_is_not_used_by_the_filter() -> None:
    usual = wearing(3)
    unexplained = observation(140.0, friction=0.9, explained=False)
    with_unexplained = Evidence("S1", "P1", 150.0, (*usual.observations, unexplained))
    without, with_it = prognose(usual, WORN), prognose(with_unexplained, WORN)
    assert np.array_equal(without.sample, with_it.sample)
    assert "1 of 4 diagnoses are not explained and not used" in with_it.notes


@pytest.mark.usefixtures("few_paths")
def test_a_healthy_unit_with_unexplained_newest_recordings_is_to_be_inspected_now() -> None:
    """The forecast from the explained diagnoses has no failure; the newest diagnoses are not explained."""
    usual = wearing(7, rate=0.0)
    unexplained = [observation(hours, friction=0.9, explained=False) for hours in (360.0, 390.0)]
    blind = Evidence("S1", "P1", 400.0, (*usual.observations, *unexplained))
    prognosis = prognose(blind, WORN)
    assert prognose(usual, WORN).advice.action == "fly on"
    assert (prognosis.advice.action, prognosis.advice.hours, prognosis.advice.risk) == (
        "inspect by",
        0.0,
        0.0,
    )
    assert "advice: inspect now (the newest recordings, of 360 h to 390 h, are not explained" in str(
        prognosis
    )
    assert "2 of 9 diagnoses are not explained and not used, the newest among them" in prognosis.notes
    assert "otherwise replace" not in prognosis.advice.reason
    assert prognosis.to_dict()["diagnoses"] == {
        "used": 7,
        "flights": 7,
        "kept": 9,
        "newest_explained": False,
    }
    followed_by_explained = replace(blind, observations=(*blind.observations, observation(395.0)))
    assert prognose(followed_by_explained, WORN).advice.action == "fly on"
    assert replace(blind, replacements=((395.0, "friction"),)).unexplained is None
    # One explained recording is enough for a flight that consists of several recordings.
    partly_explained = replace(blind, observations=(*usual.observations, observation(360.0), unexplained[0]))
    assert partly_explained.unexplained is None


@pytest.mark.usefixtures("few_paths")
def test_a_worn_unit_with_an_unexplained_newest_recording_is_to_be_inspected_now() -> None:
    worn = wearing(10, rate=1e-3)
    usual = prognose(worn, WORN)
    unexplained = observation(510.0, friction=0.9, explained=False)
    prognosis = prognose(replace(worn, observations=(*worn.observations, unexplained)), WORN)
    assert usual.advice.action == "replace before"
    assert usual.advice.hours > 0
    assert (prognosis.advice.action, prognosis.advice.hours) == ("inspect by", 0.0)
    assert "the newest recording, of 510 h, is not explained" in prognosis.advice.reason
    assert f"otherwise replace within {usual.advice.hours:,.0f} h" in prognosis.advice.reason
    # A unit that had already failed according to the earlier diagnoses is replaced now.
    failed = wearing(14, rate=1e-3)
    unexplained = observation(710.0, explained=False)
    prognosis = prognose(replace(failed, observations=(*failed.observations, unexplained)), WORN)
    assert (prognosis.advice.action, prognosis.advice.hours) == ("replace before", 0.0)


@pytest.mark.usefixtures("few_steps")
def test_a_unit_is_replaced_now_only_if_a_diagnosis_shows_a_violation() -> None:
    """After 20,000 h without a diagnosis, the prior alone makes a failure likely."""
    many = requiring(*(Requirement(component=name, at_most=0.4) for name in COMPONENTS if name != "gain"))
    blind = prognose(Evidence("S1", "P1", 20_000.0), many)
    assert blind.interval90[0] == blind.median == 0
    assert (blind.advice.action, blind.advice.hours) == ("inspect by", 0.0)
    assert "according to the prior alone" in blind.advice.reason
    unexplained = observation(20_000.0, explained=False)
    blind = prognose(Evidence("S1", "P1", 20_000.0, (unexplained,)), many)
    assert "the forecast, from the prior alone, does not include" in blind.advice.reason
    # A violation that a diagnosis shows remains one until its component is replaced.
    worn = replace(wearing(4, start=0.6), hours=250.0)
    assert prognose(worn, WORN).advice.action == "replace before"
    repaired = replace(worn, hours=60_000.0, replacements=((200.0, "friction"),))
    assert prognose(repaired, WORN).advice.action == "inspect by"


@pytest.mark.usefixtures("few_steps")
def test_an_error_shared_by_all_diagnoses_is_noted_where_it_dominates() -> None:
    worn, shared = wearing(12), np.zeros((8, 8))
    shared[0, 0] = 0.05**2
    observations = [
        replace(observation, covariance=observation.covariance + shared, shared=shared)
        for observation in worn.observations
    ]
    with_shared_errors = replace(worn, observations=tuple(observations))
    (note,) = [note for note in prognose(with_shared_errors, WORN).notes if "have the same error" in note]
    assert "0.098 in friction" in note
    assert not any("have the same error" in note for note in prognose(worn, WORN).notes)


@pytest.mark.usefixtures("few_steps")
def test_a_replacement_resets_the_level_of_its_component() -> None:
    worn = wearing(6, rate=4e-4, every=100.0)
    replaced = Evidence("S1", "P1", worn.hours, worn.observations, ((worn.hours, "friction"),))
    whole = Evidence("S1", "P1", worn.hours, worn.observations, ((worn.hours, "unit"),))
    before, after, new = (prognose(evidence, WORN) for evidence in (worn, replaced, whole))
    assert after.levels()["friction"]["median"] < 0.1
    assert new.levels()["friction"]["median"] < 0.1
    assert after.probability_of_failure < before.probability_of_failure + 0.1


@pytest.mark.usefixtures("few_steps")
def test_few_diagnoses_are_noted() -> None:
    notes = " ".join(prognose(wearing(1), WORN).notes)
    assert "flights with an explained diagnosis: 1; 3 are needed to estimate a rate" in notes
    assert "follow from the general prior" in notes
    without_diagnoses = prognose(Evidence("S1", "P1", 10.0), THESIS)
    assert "flights with an explained diagnosis: 0" in without_diagnoses.notes[0]
    assert any("states no [[requirements]]" in note for note in without_diagnoses.notes)
    # Several recordings of one flight have no information on a rate.
    once = wearing(1)
    thrice = prognose(replace(once, observations=once.observations * 3), WORN)
    assert "flights with an explained diagnosis: 1" in thrice.notes[0]
    assert "explained diagnoses of 1 of 3 flights" in thrice.rul_text()
    assert thrice.to_dict()["diagnoses"]["flights"] == 1


@pytest.mark.usefixtures("few_steps")
def test_components_without_estimates_are_assumed_healthy_and_noted() -> None:
    unseen = EVERYTHING.copy()
    unseen[2:5] = False
    observations = tuple(
        Observation(observed.hours, observed.level, observed.covariance, unseen)
        for observed in wearing(3).observations
    )
    narrow = requiring(Requirement(component="short_a", at_most=0.02))
    prognosis = prognose(Evidence("S1", "P1", 150.0, observations), narrow, Question(horizon=20_000.0))
    assert (
        "not estimated by any diagnosis, and assumed to be healthy: short_a, short_b, short_c"
        in prognosis.notes
    )
    assert prognosis.probabilities()["short_a at most 0.02"] == 0


@pytest.mark.usefixtures("few_steps")
def test_json_is_finite_and_has_the_documented_keys() -> None:
    prognosis = prognose(wearing(5, rate=0.0), WORN, Question(100.0))
    values = prognosis.to_dict()
    json.dumps(values, allow_nan=False)
    assert {"rul_hours", "probability_of_failure", "component", "requirement", "advice"} <= set(values)
    assert set(values["rul_hours"]) == {"median", "interval90"}
    assert values["rul_hours"]["interval90"][1] is None  # no failure in sight
    assert math.isinf(prognosis.interval90[1])
    assert "no failure in sight" in str(prognosis)


def test_a_measure_fails_at_the_same_time_as_its_equivalent_level() -> None:
    """Free play is linear in the backlash, so its requirement is equivalent to one on the level."""
    limit = 0.4
    play = 5e-3 * (1 + 9 * limit) / 500
    hours = np.linspace(0, 1000, 21)
    level = np.tile(NEW, (21, 50, 1))
    level[:, :, 1] = hours[:, np.newaxis] / 1000 * np.linspace(0.2, 1.0, 50)
    forecast = Paths(hours, level, np.zeros((20, 50, 8)))
    requirements = Requirements(
        requiring(
            Requirement(component="backlash", at_most=limit), Requirement(measure="free_play", at_most=play)
        )
    )
    times = failure_times(forecast, requirements, seed=0)
    assert times.hours[1] == pytest.approx(times.hours[0], rel=1e-3)
    assert responsible(forecast, times, 1, requirements) == "backlash"


WANDERING = DegradationSettings(
    laws=(0, 0, 0, 0, 0, 1), life_scale=(1000.0, 2000.0), rate_noise=1.0, noise=0.0, unevenness=(1e-9, 2e-9)
)
"""Settings for levels that rise and fall."""


@pytest.mark.parametrize("horizon", [10_000.0, 100_000.0])
def test_a_recovering_measure_fails_at_the_same_step_as_its_equivalent_level(horizon: float) -> None:
    """Free play is linear in the backlash: equivalent limits on the two are violated at the same step."""
    settings = ForecastSettings(paths=250, longest_hours=2 * horizon)
    state = drawn_states(Belief.new(Prior(WANDERING)), settings.paths)
    forecast = paths(state, Prior(WANDERING), seed=1, settings=settings)
    forecast = replace(forecast, noise=np.zeros_like(forecast.noise))
    wide = THESIS.mechanics.backlash * THESIS.mechanics.gear_ratio * (1 + 9 * 0.6)
    requirements = Requirements(
        requiring(
            Requirement(component="backlash", at_most=0.6), Requirement(measure="free_play", at_most=wide)
        )
    )
    of_level, of_measure = failure_times(forecast, requirements, seed=0).hours
    recovered = np.isfinite(of_level) & (forecast.level[-1, :, 1] < 0.6)
    assert recovered.mean() > 0.2
    # The steps are equal; within a step, a level beyond the end of its scale is interpolated differently.
    assert np.array_equal(
        *(np.searchsorted(forecast.hours, 0.999999 * hours) for hours in (of_level, of_measure))
    )


def test_a_measure_fails_at_the_first_violation_found_by_simulating_all_times() -> None:
    """The reference simulates every time of every path; a bisection from the end would miss failures."""
    settings = ForecastSettings(paths=60, longest_hours=4000.0, steps=40)
    forecast = paths(
        drawn_states(Belief.new(Prior(WANDERING)), settings.paths),
        Prior(WANDERING),
        seed=2,
        settings=settings,
    )
    for requirement in (
        Requirement(measure="tracking_error", at_most=2.0e-3, duration=0.2),
        Requirement(measure="settling_time", at_most=0.03, duration=0.1),
    ):
        requirements = Requirements(requiring(requirement))
        vectors = vectors_of(forecast.level, THESIS)
        fails = np.stack([requirements.margins(at)[0] for at in vectors]) < 0
        ever = fails.any(axis=0)
        assert ever.mean() > fails[-1].mean() + 0.05
        (passed,) = failure_times(forecast, requirements, seed=0).hours
        assert np.mean(np.isfinite(passed) == ever) > 0.98
        step = np.minimum(np.searchsorted(forecast.hours, passed), settings.steps)
        first = fails.argmax(axis=0)
        assert np.mean(step[ever] > first[ever] + 1) < 0.05


def test_a_measure_that_fails_without_faults_has_no_responsible_component() -> None:
    """A step against a load larger than the motor's torque does not settle."""
    requirements = Requirements(requiring(Requirement(measure="settling_time", at_most=0.1, load=5.0)))
    hours, level = np.array([0.0, 100.0]), np.tile(NEW, (2, 5, 1))
    forecast = Paths(hours, level, np.zeros((1, 5, 8)))
    times = failure_times(forecast, requirements, seed=0)
    assert not times.first.any()
    assert responsible(forecast, times, 0, requirements) is None


def test_an_additional_wider_limit_does_not_change_the_first_failure() -> None:
    """The level scatters strongly; the limits of one component are evaluated on the same path."""
    random, hours = np.random.default_rng(0), np.linspace(0, 1000, 6)
    level = np.tile(NEW, (6, 400, 1))
    level[1:, :, 0] = 0.12 * np.arange(1, 6)[:, np.newaxis] + 0.05 * random.standard_normal((5, 400))
    forecast = Paths(hours, level, np.full((5, 400, 8), 0.01))
    single, several = (
        failure_times(
            forecast,
            Requirements(requiring(*(Requirement(component="friction", at_most=x) for x in bounds))),
            seed=0,
        )
        for bounds in ((0.4,), (0.5, 0.4, 0.41))
    )
    assert np.array_equal(several.first, single.first)
    assert several.limits[several.commonest or 0].bound == 0.4
    assert np.all(several.hours[0] >= several.hours[2])


@pytest.mark.evidence
@pytest.mark.usefixtures("few_paths")
def test_probability_integral_transforms_of_units_from_the_prior_are_uniform() -> None:
    """The units are drawn from the prior and diagnosed for 600 h."""
    actuator, transforms = requiring(Requirement(component="friction", at_most=0.5)), []
    requirements, random = Requirements(actuator), np.random.default_rng(11)
    start = drawn_states(Belief.new(Prior(), seed=5), 400)
    truths = paths(start, Prior(), seed=6)
    ends = failure_times(truths, requirements, seed=6).first
    for i in np.flatnonzero((ends > 650) & (ends < 15_000))[:16]:
        observations = []
        for hours in range(100, 601, 100):
            level = [np.interp(hours, truths.hours, truths.level[:, i, c]) for c in range(8)]
            noisy = np.asarray(level) + ERROR * random.standard_normal(8)
            observations.append(Observation(float(hours), noisy, ERROR**2 * np.eye(8), EVERYTHING))
        prognosis = prognose(Evidence("S", "P", 600.0, tuple(observations)), actuator, seed=int(i))
        given_failure = _given_failure(prognosis.sample, 50.0, 14_400.0)
        transforms.append(probability_integral_transform(Prediction(600.0, given_failure), ends[i] - 600))
    assert kstest(transforms, "uniform").pvalue > 0.01


def _given_failure(sample: Array, low: float, high: float) -> Array:
    """Return the sample conditioned on a failure between two times, as the true lives are."""
    return sample[(sample > low) & (sample < high)]


@pytest.mark.usefixtures("few_steps")
def test_a_fleet_prior_narrows_the_rul_of_a_new_unit() -> None:
    fleet = fleet_prior([wearing(4, rate=4e-4, unit=f"F{i}", seed=i, every=350.0) for i in range(6)])
    assert (fleet.units, fleet.fleet_share) == (6, 0.75)
    new = wearing(2, rate=4e-4, unit="new", seed=99)
    alone, by_fleet = prognose(new, WORN), prognose(new, WORN, prior=fleet)
    true = 0.6 / 4e-4 - 100
    wide, narrow = (prognosis.sample.clip(max=20_000) for prognosis in (alone, by_fleet))
    assert np.mean(np.abs(narrow - true)) < np.mean(np.abs(wide - true))
    assert np.mean(np.abs(narrow / true - 1) < 0.3) > np.mean(np.abs(wide / true - 1) < 0.3)
    assert "mostly follow from 6 other units" in " ".join(by_fleet.notes)


def test_units_with_too_few_diagnoses_give_no_fleet_prior() -> None:
    assert fleet_prior([Evidence("A", "P1", 5.0), wearing(2)]).fleet is None


def test_a_diagnosis_that_is_not_finite_is_refused() -> None:
    broken = Observation(5.0, np.full(8, np.nan), np.eye(8), EVERYTHING)
    with pytest.raises(PrognosisError, match="unit 'S1': the diagnosis at 5 h is not finite"):
        prognose(Evidence("S1", "P1", 5.0, (broken,)), WORN)


@pytest.mark.usefixtures("few_steps")
def test_equal_seeds_give_equal_samples_and_other_seeds_give_others() -> None:
    first, repeated, other_seed = (prognose(wearing(2), WORN, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(first.sample, repeated.sample)
    assert not np.array_equal(first.sample, other_seed.sample)


@pytest.mark.parametrize(
    "case", [*range(4), *(pytest.param(case, marks=pytest.mark.evidence) for case in range(4, 16))]
)
def test_unusual_histories_have_a_prognosis_without_errors(case: int) -> None:
    """Gaps of years, singular or tiny covariances, levels beyond bounds, replacements: results are finite."""
    random = np.random.default_rng(case)
    observations = []
    for hours in np.sort(random.uniform(0, 10 ** random.uniform(1, 4.7), random.integers(0, 12))):
        root = 10 ** random.uniform(-9, 0) * random.standard_normal((8, random.integers(1, 12)))
        level = np.clip(NEW + random.standard_normal(8) * 10 ** random.uniform(-3, 0), -1, 1)
        seen = EVERYTHING.copy()
        seen[2:7] = case % 4 > 0
        observations.append(
            Observation(float(hours), level, root @ root.T, seen, bool(random.random() < 0.9))
        )
    replacements = tuple(
        (float(random.uniform(0, 50_000)), name) for name in ("unit", "eccentricity") if random.random() < 0.3
    )
    ends = [observation.hours for observation in observations] + [hours for hours, _ in replacements]
    evidence = Evidence("S1", "P1", max(ends, default=0.0), tuple(observations), replacements)
    prognosis = prognose(evidence, THESIS, seed=case, settings=ForecastSettings(paths=100, steps=30))
    assert np.all(prognosis.sample >= 0)
    assert np.all(np.isfinite(prognosis.paths.level))
    json.dumps(prognosis.to_dict(), allow_nan=False)


def test_a_level_that_is_rounded_to_zero_has_no_sign() -> None:
    friction = {"median": -0.0002, "interval90": [-0.0004, 0.001], "laws": {"constant": 1.0}}
    assert level_table({"friction": friction}).rows == (
        ("friction", "0.000", "0.000 to 0.001", "constant (100 %)"),
    )
