"""Prognoses of units whose end is known, what notes they carry, and what a fleet teaches."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from emaphm.actuator import Actuator
from emaphm.actuator.requirements import Requirement
from emaphm.arrays import Array
from emaphm.errors import PrognosisError
from emaphm.prognosis import Evidence, Observation, Question, fleet_prior, prognose
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.forecast import Paths, drawn_states, paths
from emaphm.prognosis.metrics import Prediction, probability_integral_transform
from emaphm.prognosis.prior import NEW, Prior
from emaphm.prognosis.requirements import Requirements, vectors_of
from emaphm.prognosis.requirements.failure_times import failure_times, responsible
from emaphm.prognosis.settings import DegradationSettings, ForecastSettings

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
    """Return a unit whose friction rises evenly, diagnosed `every` so many hours."""
    observations = tuple(
        observation(every * i, seed=seed, friction=start + rate * every * i) for i in range(1, count + 1)
    )
    return Evidence(unit, "P1", every * count, observations)


@pytest.mark.parametrize("seed", range(2))
def test_wear_within_a_day_is_followed_whatever_the_seed(seed: int) -> None:
    # Of a thousand draws of a rate few are as fast: 0.04 in an hour, up to the limit at 15 h.
    found = prognose(
        wearing(6, rate=0.04, every=2.0, seed=seed), WORN, Question(100.0), seed=seed, keep_past=False
    )
    assert found.interval90[0] < 15 - 12 + 2
    assert found.median < 15


@pytest.mark.usefixtures("few_paths")
def test_a_straight_line_is_followed_to_its_limit() -> None:
    made = prognose(wearing(10, every=200.0), WORN)
    true = 0.6 / 2e-4 - 2000
    assert made.median == pytest.approx(true, rel=0.15)
    low, high = made.interval90
    assert low < true < high
    assert (made.component, made.limit and made.limit.label) == ("friction", "friction at most 0.6")
    assert made.advice.action in {"replace before", "inspect by"}


@pytest.mark.usefixtures("few_steps")
def test_an_eccentricity_grows_along_its_direction() -> None:
    observations = tuple(observation(250.0 * i, x=0.05 * i * 0.6, y=0.05 * i * 0.8) for i in range(1, 7))
    made = prognose(Evidence("S1", "P1", 1500.0, observations), WORN)
    assert made.component == "eccentricity"
    assert made.median == pytest.approx(1000.0, rel=0.25)
    assert made.levels()["eccentricity"]["median"] == pytest.approx(0.3, abs=0.02)


@pytest.mark.usefixtures("few_steps")
def test_what_is_violated_has_no_life_left() -> None:
    made = prognose(wearing(4, start=0.7), WORN)
    assert made.to_dict()["rul_hours"] == {"median": 0.0, "interval90": [0.0, 0.0]}
    assert made.probability_of_failure == 1
    assert "violated already: friction at most 0.6" in made.notes
    assert made.advice.action == "replace before"


def test_a_requirement_that_a_new_actuator_violates_is_refused() -> None:
    wrong = requiring(Requirement(measure="tracking_error", at_most=4e-4))
    with pytest.raises(PrognosisError, match=r"a new actuator .* violates .*tracking_error at most"):
        prognose(wearing(3), wrong)


@pytest.mark.usefixtures("few_steps")
def test_a_requirement_that_no_fault_can_violate_is_named() -> None:
    made = prognose(wearing(3), requiring(Requirement(measure="free_play", at_most=1.0)))
    assert math.isinf(made.median)
    assert "no single fault at the end of its scale violates: free_play at most 1 rad" in made.notes


@pytest.mark.usefixtures("few_steps")
def test_a_level_cannot_fall_below_the_end_of_its_scale() -> None:
    """As `failure_levels` has it of a healthy unit, of which diagnoses scatter to both sides of 0."""
    made = prognose(wearing(3, rate=0.0), requiring(Requirement(component="backlash", at_least=0.0)))
    assert math.isinf(made.median)
    assert made.probability_of_failure == 0
    assert "no single fault at the end of its scale violates: backlash at least 0" in made.notes


@pytest.mark.usefixtures("few_steps")
def test_a_friction_below_that_of_a_new_unit_is_no_nearer_to_its_limit() -> None:
    worn_in, new = (prognose(wearing(5, rate=0.0, start=start, every=100.0), WORN) for start in (-0.1, 0.0))
    assert worn_in.levels()["friction"]["median"] == pytest.approx(-0.1, abs=ERROR)
    label = worn_in.times.limits[0].label
    assert worn_in.probabilities()[label] <= new.probabilities()[label] + 0.01
    assert worn_in.median >= 0.8 * new.median


@pytest.mark.usefixtures("few_steps")
def test_a_friction_that_falls_fails_where_its_line_does() -> None:
    lost_preload = requiring(Requirement(component="friction", at_least=-0.3))
    made = prognose(wearing(5, rate=-2e-4, every=200.0), lost_preload)
    assert made.component == "friction"
    assert made.median == pytest.approx(0.3 / 2e-4 - made.evidence.hours, rel=0.15)


@pytest.mark.usefixtures("few_steps")
def test_an_unexplained_diagnosis_is_not_fed() -> None:
    usual = wearing(3)
    odd = observation(140.0, friction=0.9, explained=False)
    with_odd = Evidence("S1", "P1", 150.0, (*usual.observations, odd))
    one, other = prognose(usual, WORN), prognose(with_odd, WORN)
    assert np.array_equal(one.sample, other.sample)
    assert "1 of 4 diagnoses are not explained and not used" in other.notes


@pytest.mark.usefixtures("few_paths")
def test_a_unit_whose_newest_recordings_are_not_explained_is_not_advised_to_fly_on() -> None:
    """The forecast, from the diagnoses before, sees no failure; what came since is like none of them."""
    usual = wearing(7, rate=0.0)
    odd = [observation(hours, friction=0.9, explained=False) for hours in (360.0, 390.0)]
    blind = Evidence("S1", "P1", 400.0, (*usual.observations, *odd))
    made = prognose(blind, WORN)
    assert prognose(usual, WORN).advice.action == "fly on"
    assert (made.advice.action, made.advice.hours, made.advice.risk) == ("inspect by", 0.0, 0.0)
    assert "advice: inspect now (the newest recordings, of 360 h to 390 h, are not explained" in str(made)
    assert "2 of 9 diagnoses are not explained and not used, the newest among them" in made.notes
    assert "otherwise replace" not in made.advice.reason
    assert made.to_dict()["diagnoses"] == {"used": 7, "kept": 9, "newest_explained": False}
    seen = replace(blind, observations=(*blind.observations, observation(395.0)))
    assert prognose(seen, WORN).advice.action == "fly on"
    assert replace(blind, replacements=((395.0, "friction"),)).unexplained is None
    # Of a flight that was cut into several recordings, one that is explained is enough.
    part = replace(blind, observations=(*usual.observations, observation(360.0), odd[0]))
    assert part.unexplained is None


@pytest.mark.usefixtures("few_paths")
def test_a_worn_unit_whose_newest_recording_is_not_explained_may_fly_no_longer_than_a_healthy_one() -> None:
    worn = wearing(10, rate=1e-3)
    usual = prognose(worn, WORN)
    odd = observation(510.0, friction=0.9, explained=False)
    made = prognose(replace(worn, observations=(*worn.observations, odd)), WORN)
    assert usual.advice.action == "replace before"
    assert usual.advice.hours > 0
    assert (made.advice.action, made.advice.hours) == ("inspect by", 0.0)
    assert "the newest recording, of 510 h, is not explained" in made.advice.reason
    assert f"otherwise replace within {usual.advice.hours:,.0f} h" in made.advice.reason
    # What has failed already by the diagnoses before is replaced now all the same.
    gone = wearing(14, rate=1e-3)
    odd = observation(710.0, explained=False)
    made = prognose(replace(gone, observations=(*gone.observations, odd)), WORN)
    assert (made.advice.action, made.advice.hours) == ("replace before", 0.0)


@pytest.mark.usefixtures("few_steps")
def test_what_diagnoses_share_is_said_where_it_is_most_of_what_is_not_known() -> None:
    worn, shared = wearing(12), np.zeros((8, 8))
    shared[0, 0] = 0.05**2
    observations = [
        replace(one, covariance=one.covariance + shared, shared=shared) for one in worn.observations
    ]
    within = replace(worn, observations=tuple(observations))
    (note,) = [one for one in prognose(within, WORN).notes if "have the same error" in one]
    assert "0.098 in friction" in note
    assert not any("have the same error" in one for one in prognose(worn, WORN).notes)


@pytest.mark.usefixtures("few_steps")
def test_a_replacement_gives_a_new_life() -> None:
    worn = wearing(6, rate=4e-4, every=100.0)
    replaced = Evidence("S1", "P1", worn.hours, worn.observations, ((worn.hours, "friction"),))
    whole = Evidence("S1", "P1", worn.hours, worn.observations, ((worn.hours, "unit"),))
    before, after, new = (prognose(one, WORN) for one in (worn, replaced, whole))
    assert after.levels()["friction"]["median"] < 0.1
    assert new.levels()["friction"]["median"] < 0.1
    assert after.probability_of_failure < before.probability_of_failure + 0.1


@pytest.mark.usefixtures("few_steps")
def test_few_diagnoses_say_so() -> None:
    notes = " ".join(prognose(wearing(1), WORN).notes)
    assert "explained diagnoses: 1; 3 are needed to estimate a rate" in notes
    assert "follow from the general prior" in notes
    none = prognose(Evidence("S1", "P1", 10.0), THESIS)
    assert "explained diagnoses: 0" in none.notes[0]
    assert any("states no [[requirements]]" in note for note in none.notes)


@pytest.mark.usefixtures("few_steps")
def test_what_no_diagnosis_sees_is_taken_as_healthy_and_named() -> None:
    unseen = EVERYTHING.copy()
    unseen[2:5] = False
    observations = tuple(
        Observation(one.hours, one.level, one.covariance, unseen) for one in wearing(3).observations
    )
    narrow = requiring(Requirement(component="short_a", at_most=0.02))
    made = prognose(Evidence("S1", "P1", 150.0, observations), narrow, Question(horizon=20_000.0))
    assert (
        "not estimated by any diagnosis, and assumed to be healthy: short_a, short_b, short_c" in made.notes
    )
    assert made.probabilities()["short_a at most 0.02"] == 0


@pytest.mark.usefixtures("few_steps")
def test_json_is_finite_and_has_the_keys_that_are_promised() -> None:
    made = prognose(wearing(5, rate=0.0), WORN, Question(100.0))
    values = made.to_dict()
    json.dumps(values, allow_nan=False)
    assert {"rul_hours", "probability_of_failure", "component", "requirement", "advice"} <= set(values)
    assert set(values["rul_hours"]) == {"median", "interval90"}
    assert values["rul_hours"]["interval90"][1] is None  # no failure in sight
    assert math.isinf(made.interval90[1])
    assert "no failure in sight" in str(made)


def test_a_measure_fails_where_its_level_does() -> None:
    """Free play is a line in the backlash: the requirement on it is one on the level."""
    limit = 0.4
    play = 5e-3 * (1 + 9 * limit) / 500
    hours = np.linspace(0, 1000, 21)
    level = np.tile(NEW, (21, 50, 1))
    level[:, :, 1] = hours[:, np.newaxis] / 1000 * np.linspace(0.2, 1.0, 50)
    made = Paths(hours, level, np.zeros((20, 50, 8)))
    requirements = Requirements(
        requiring(
            Requirement(component="backlash", at_most=limit), Requirement(measure="free_play", at_most=play)
        )
    )
    times = failure_times(made, requirements, seed=0)
    assert times.hours[1] == pytest.approx(times.hours[0], rel=1e-3)
    assert responsible(made, times, 1, requirements) == "backlash"


WANDERING = DegradationSettings(
    laws=(0, 0, 0, 0, 0, 1), life_scale=(1000.0, 2000.0), rate_noise=1.0, noise=0.0, unevenness=(1e-9, 2e-9)
)
"""Levels that rise and fall again."""


@pytest.mark.parametrize("horizon", [10_000.0, 100_000.0])
def test_a_measure_that_recovers_failed_when_its_level_did(horizon: float) -> None:
    """Free play is the backlash: a limit on the one fails where the same limit on the other does."""
    settings = ForecastSettings(paths=250, longest_hours=2 * horizon)
    state = drawn_states(Belief.new(Prior(WANDERING)), settings.paths)
    made = paths(state, Prior(WANDERING), seed=1, settings=settings)
    made = replace(made, noise=np.zeros_like(made.noise))
    wide = THESIS.mechanics.backlash * THESIS.mechanics.gear_ratio * (1 + 9 * 0.6)
    requirements = Requirements(
        requiring(
            Requirement(component="backlash", at_most=0.6), Requirement(measure="free_play", at_most=wide)
        )
    )
    of_level, of_measure = failure_times(made, requirements, seed=0).hours
    recovered = np.isfinite(of_level) & (made.level[-1, :, 1] < 0.6)
    assert recovered.mean() > 0.2
    # In the same step of the path; within it, a level beyond the end of its scale is interpolated otherwise.
    assert np.array_equal(*(np.searchsorted(made.hours, 0.999999 * one) for one in (of_level, of_measure)))


def test_a_measure_fails_at_the_first_time_at_which_the_model_finds_it_failed() -> None:
    """Against the model run at every time of every path; a bisection from its end sees fewer failures."""
    settings = ForecastSettings(paths=60, longest_hours=4000.0, steps=40)
    made = paths(
        drawn_states(Belief.new(Prior(WANDERING)), settings.paths),
        Prior(WANDERING),
        seed=2,
        settings=settings,
    )
    for one in (
        Requirement(measure="tracking_error", at_most=2.0e-3, duration=0.2),
        Requirement(measure="settling_time", at_most=0.03, duration=0.1),
    ):
        requirements = Requirements(requiring(one))
        vectors = vectors_of(made.level, THESIS)
        fails = np.stack([requirements.margins(at)[0] for at in vectors]) < 0
        ever = fails.any(axis=0)
        assert ever.mean() > fails[-1].mean() + 0.05
        (found,) = failure_times(made, requirements, seed=0).hours
        assert np.mean(np.isfinite(found) == ever) > 0.98
        step = np.minimum(np.searchsorted(made.hours, found), settings.steps)
        first = fails.argmax(axis=0)
        assert np.mean(step[ever] > first[ever] + 1) < 0.05


def test_a_measure_that_fails_whatever_the_faults_has_no_component() -> None:
    """A step against a load that is larger than the motor's torque does not settle."""
    requirements = Requirements(requiring(Requirement(measure="settling_time", at_most=0.1, load=5.0)))
    hours, level = np.array([0.0, 100.0]), np.tile(NEW, (2, 5, 1))
    made = Paths(hours, level, np.zeros((1, 5, 8)))
    times = failure_times(made, requirements, seed=0)
    assert not times.first.any()
    assert responsible(made, times, 0, requirements) is None


def test_a_wider_limit_shortens_no_life() -> None:
    """Of a level that scatters much; all limits of each component are passed by the same path."""
    random, hours = np.random.default_rng(0), np.linspace(0, 1000, 6)
    level = np.tile(NEW, (6, 400, 1))
    level[1:, :, 0] = 0.12 * np.arange(1, 6)[:, np.newaxis] + 0.05 * random.standard_normal((5, 400))
    made = Paths(hours, level, np.full((5, 400, 8), 0.01))
    one, several = (
        failure_times(
            made,
            Requirements(requiring(*(Requirement(component="friction", at_most=x) for x in bounds))),
            seed=0,
        )
        for bounds in ((0.4,), (0.5, 0.4, 0.41))
    )
    assert np.array_equal(several.first, one.first)
    assert several.limits[several.commonest or 0].bound == 0.4
    assert np.all(several.hours[0] >= several.hours[2])


@pytest.mark.evidence
@pytest.mark.usefixtures("few_paths")
def test_transforms_of_units_from_the_prior_are_uniform() -> None:
    """Units drawn from the prior, seen for 600 h: the RUL's probability integral transforms are uniform."""
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
        made = prognose(Evidence("S", "P", 600.0, tuple(observations)), actuator, seed=int(i))
        shown = _given_failure(made.sample, 50.0, 14_400.0)
        transforms.append(probability_integral_transform(Prediction(600.0, shown), ends[i] - 600))
    assert kstest(transforms, "uniform").pvalue > 0.01


def _given_failure(sample: Array, low: float, high: float) -> Array:
    """Return a sample given what the truths were chosen by: a failure between two times."""
    return sample[(sample > low) & (sample < high)]


@pytest.mark.usefixtures("few_steps")
def test_a_fleet_narrows_the_first_life_of_a_new_unit() -> None:
    fleet = fleet_prior([wearing(4, rate=4e-4, unit=f"F{i}", seed=i, every=350.0) for i in range(6)])
    assert (fleet.units, fleet.fleet_share) == (6, 0.75)
    new = wearing(2, rate=4e-4, unit="new", seed=99)
    alone, taught = prognose(new, WORN), prognose(new, WORN, prior=fleet)
    true = 0.6 / 4e-4 - 100
    wide, narrow = (one.sample.clip(max=20_000) for one in (alone, taught))
    assert np.mean(np.abs(narrow - true)) < np.mean(np.abs(wide - true))
    assert np.mean(np.abs(narrow / true - 1) < 0.3) > np.mean(np.abs(wide / true - 1) < 0.3)
    assert "mostly follow from 6 other units" in " ".join(taught.notes)


def test_units_without_diagnoses_teach_nothing() -> None:
    assert fleet_prior([Evidence("A", "P1", 5.0), wearing(2)]).fleet is None


def test_a_diagnosis_that_is_not_finite_is_refused() -> None:
    broken = Observation(5.0, np.full(8, np.nan), np.eye(8), EVERYTHING)
    with pytest.raises(PrognosisError, match="unit 'S1': the diagnosis at 5 h is not finite"):
        prognose(Evidence("S1", "P1", 5.0, (broken,)), WORN)


@pytest.mark.usefixtures("few_steps")
def test_same_seed_same_numbers() -> None:
    one, same, other = (prognose(wearing(2), WORN, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(one.sample, same.sample)
    assert not np.array_equal(one.sample, other.sample)


@pytest.mark.parametrize(
    "case", [*range(4), *(pytest.param(case, marks=pytest.mark.evidence) for case in range(4, 16))]
)
def test_odd_histories_have_a_prognosis_too(case: int) -> None:
    """Gaps of years, singular or tiny covariances, levels beyond bounds, replacements: numbers, no error."""
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
    ends = [one.hours for one in observations] + [hours for hours, _ in replacements]
    evidence = Evidence("S1", "P1", max(ends, default=0.0), tuple(observations), replacements)
    made = prognose(evidence, THESIS, seed=case, settings=ForecastSettings(paths=100, steps=30))
    assert np.all(made.sample >= 0)
    assert np.all(np.isfinite(made.paths.level))
    json.dumps(made.to_dict(), allow_nan=False)
