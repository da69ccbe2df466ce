"""The prior from other units: their trajectories, time scales and scatter, against known trajectories."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from emaphm.arrays import Array
from emaphm.history import History
from emaphm.prognosis import Evidence, Observation, StressReference, fleet_prior, learnt_prior
from emaphm.prognosis.filter.following import Moment, follow, moments
from emaphm.prognosis.filter.resampling import apart_again, kinds_of
from emaphm.prognosis.from_fleet import learning
from emaphm.prognosis.from_fleet.fingerprint import fingerprint
from emaphm.prognosis.from_fleet.reference_trajectories import ReferenceTrajectories, Trajectory
from emaphm.prognosis.laws import transition
from emaphm.prognosis.prior import NEW, Prior
from emaphm.prognosis.settings import AS_ANOTHER, CONSTANT, DEGRADATION, FilterSettings
from history import made_up

HOURS = np.arange(50.0, 2001.0, 50.0)


def saturating(hours: Array | float) -> Array:
    """Return a level that saturates; no law of the filter does so."""
    return np.asarray(0.7 / (1 + np.exp(-(np.asarray(hours) - 900.0) / 180.0)))


def trajectory(level: Array) -> Trajectory:
    levels = np.tile(NEW, (HOURS.size, 1))
    levels[:, 0] = level
    return Trajectory(HOURS, np.tile(HOURS[:, np.newaxis], 8), levels, np.zeros(8), np.full(8, np.inf), NEW)


def test_a_component_follows_another_units_trajectory_on_its_own_time_scale() -> None:
    trajectories = ReferenceTrajectories.of([trajectory(np.zeros(HOURS.size)), trajectory(saturating(HOURS))])
    law, unit = np.full((1, 8), AS_ANOTHER, np.int8), np.ones((1, 8))
    scale = np.full((1, 8), 4000.0)  # twice the other unit's time
    for age, step in ((200.0, 300.0), (1500.0, 900.0), (100.0, 3800.0)):
        reach, growth = transition(law, scale, unit, np.full((1, 8), age), step, DEGRADATION, trajectories)
        # Amplitude 1, so a rate of 1/T; the other unit is interpolated at 65 points.
        expected = saturating((age + step) / 2) - saturating(age / 2)
        assert reach[0, 0] / 4000.0 == pytest.approx(expected, abs=2e-3)
        assert growth[0, 0] == 1.0
        assert reach[0, 1] == pytest.approx(0.0)


def test_a_trajectory_is_extrapolated_linearly_or_as_a_power_with_equal_probability() -> None:
    trajectories = ReferenceTrajectories.of([trajectory(0.6 * (HOURS / 4000.0) ** 1.6)])
    where = np.zeros(2, int)
    straight, power = trajectories.change_at(np.array([0, 1]), np.full(2, 2.0), where)
    end = 0.6 * 0.5**1.6
    # The slope is that of the last fifth of the span: of the power law, a tenth of a span before its end.
    slope = end * 1.6 * 0.9**0.6
    assert straight == pytest.approx(end + slope, rel=0.02)
    assert power == pytest.approx(0.6, rel=0.05)
    drawn, _ = trajectories.drawn((4000, 8), np.random.default_rng(0))
    assert np.mean(drawn[:, 0]) == pytest.approx(0.5, abs=0.03)


def test_both_extrapolations_of_a_straight_or_constant_trajectory_are_linear() -> None:
    where = np.zeros(2, int)
    for level in (3e-4 * HOURS, np.zeros(HOURS.size)):
        change = ReferenceTrajectories.of([trajectory(level)]).change_at(
            np.array([0, 1]), np.full(2, 1.5), where
        )
        assert change == pytest.approx([1.5 * level[-1]] * 2, rel=1e-6)


def test_each_life_of_a_component_gives_a_separate_trajectory() -> None:
    first, later = np.arange(8) == 0, HOURS[:, np.newaxis] > 1200.0
    levels = trajectory(saturating(HOURS)).level
    levels[HOURS > 1200.0, 0] = 1e-4 * (HOURS[HOURS > 1200.0] - 1200.0)
    age = np.where(first & later, HOURS[:, np.newaxis] - 1200.0, HOURS[:, np.newaxis])
    new_at = np.where(first, [[0.0], [1200.0]], [[0.0], [np.inf]])
    until = np.where(first, [[1200.0], [np.inf]], np.inf)
    trajectories = ReferenceTrajectories.of(
        [Trajectory(HOURS, age, levels, *ends, NEW) for ends in zip(new_at, until, strict=True)]
    )
    # Each trajectory is contained twice, once for each extrapolation.
    assert trajectories.span[:, 0].tolist() == [1200.0, 800.0] * 2
    assert trajectories.span[:, 1:].tolist() == [[2000.0] * 7, [0.0] * 7] * 2
    assert trajectories.change[0, 0, -1] == pytest.approx(saturating(1200.0))
    assert trajectories.change[1, 0, -1] == pytest.approx(0.08)


def test_a_trajectory_follows_the_levels_if_the_estimated_age_falls_between_recordings_of_one_flight() -> (
    None
):
    """With the level a function of the hours, it is a straight line through the last recordings."""
    hours = np.repeat([500.0, 1000.0, 1500.0, 2000.0], 2)
    estimated = np.tile((hours + np.tile([0.0, -12.0], 4))[:, np.newaxis], 8)
    levels = np.tile(NEW, (hours.size, 1))
    levels[:, 0] = 1e-4 * hours
    twice = Trajectory(hours, estimated, levels, np.zeros(8), np.full(8, np.inf), NEW)
    trajectories = ReferenceTrajectories.of([twice])
    assert trajectories.span[0, 0] == 2000.0
    assert trajectories.change[0, 0] == pytest.approx(np.linspace(0.0, 0.2, 65), abs=1e-12)


def test_copies_of_particles_are_dispersed_without_a_larger_variance() -> None:
    random = np.random.default_rng(0)
    values = np.exp(random.normal([[1.0, 5.0]], [[0.3, 0.6]], (4000, 2)))
    kinds = kinds_of(np.zeros(values.shape, int), np.ones(2, bool))
    after = np.log(apart_again(values, kinds, FilterSettings(), random))
    assert after.mean(axis=0) == pytest.approx(np.log(values).mean(axis=0), abs=0.02)
    assert after.std(axis=0) == pytest.approx([0.3, 0.6], rel=0.04)
    assert np.abs(after - np.log(values)).min() > 0


def flown(time: float, amplitude: float, seed: int, upto: float = 2000.0, every: float = 100.0) -> Evidence:
    """Return diagnoses of a unit whose friction follows `saturating`, with its time scaled by `time`."""
    random = np.random.default_rng(seed)
    observations = []
    for hours in np.arange(every, upto + 1, every):
        level = NEW + 0.005 * random.standard_normal(8)
        level[0] += amplitude * saturating(hours / time)
        observations.append(Observation(float(hours), level, 0.005**2 * np.eye(8), np.ones(8, bool)))
    return Evidence(f"unit {seed}", "part", upto, tuple(observations))


def accelerated(unit: Evidence, factor: float) -> Evidence:
    """Return the unit with all hours divided by `factor`."""
    observations = tuple(
        replace(observation, hours=observation.hours / factor) for observation in unit.observations
    )
    return replace(unit, hours=unit.hours / factor, observations=observations)


@pytest.fixture(scope="module")
def fleet() -> list[Evidence]:
    times = np.exp(0.2 * np.random.default_rng(1).standard_normal(4))
    return [flown(float(time), 1.0, i, every=200.0) for i, time in enumerate(times)]


def test_the_posterior_of_a_new_unit_prefers_the_trajectories_of_its_fleet(fleet: list[Evidence]) -> None:
    prior = fleet_prior(fleet)
    belief = follow(flown(0.9, 1.0, 99, upto=1200.0, every=200.0), prior).belief
    assert belief.law_probabilities()[0, AS_ANOTHER] > 0.7
    assert belief.law_probabilities()[0].sum() == pytest.approx(1.0)


def test_a_fleet_with_lives_of_a_hundred_hours_gives_a_prior_of_that_scale(fleet: list[Evidence]) -> None:
    """At a twentieth of all hours, the fleet's trajectories are shorter than a law's least life scale."""
    prior = fleet_prior([accelerated(unit, 20.0) for unit in fleet[:3]])
    belief = follow(accelerated(flown(0.9, 1.0, 99, upto=1200.0, every=200.0), 20.0), prior).belief
    as_others = belief.law[:, 0] == AS_ANOTHER
    assert belief.law_probabilities()[0, AS_ANOTHER] > 0.7
    assert np.median(belief.life_scale[as_others, 0]) == pytest.approx(0.9 * 2000.0 / 20.0, rel=0.3)


def test_a_replacement_after_a_failure_keeps_the_hypotheses_of_the_failed_life() -> None:
    """A unit failed at 1,200 h; the same unit was repaired, and then flew on with its friction renewed."""
    failed = replace(flown(1.0, 1.0, 3, upto=1200.0, every=200.0), failures=(1200.0,))
    repaired = replace(failed, replacements=((1200.0, "friction"),))
    later = [
        replace(observation, hours=observation.hours + 1200.0)
        for observation in flown(1.0, 1.0, 4, upto=200.0).observations
    ]
    flies = replace(repaired, hours=1400.0, observations=(*failed.observations, *later))
    once, repaired_once, again = (
        learning.hypotheses_of_unit(unit, Prior(), 0) for unit in (failed, repaired, flies)
    )
    for other in (repaired_once, again):
        assert np.array_equal(other.trajectories[0].level[:6], once.trajectories[0].level)
        moving = [np.mean(learnt.hypotheses.law[:, 0] != CONSTANT) for learnt in (once, other)]
        assert moving[1] == pytest.approx(moving[0], abs=0.1)
        rates = [np.median(np.abs(learnt.hypotheses.rate[:, 0])) for learnt in (once, other)]
        assert rates[1] == pytest.approx(rates[0], rel=0.3)
    # Two diagnoses of the second life are too few for a trajectory.
    spans = [ReferenceTrajectories.of(learnt.trajectories).span for learnt in (once, again)]
    assert spans[1][:2, 0].tolist() == [spans[0][0, 0], 0.0]


def test_each_of_two_lives_of_a_component_gives_half_of_the_hypotheses() -> None:
    """In its first life the component is constant, in its second life it wears."""
    still, wore = (flown(1.0, amplitude, seed, every=200.0) for amplitude, seed in ((0.0, 5), (1.0, 6)))
    later = [replace(observation, hours=observation.hours + 2000.0) for observation in wore.observations]
    both = replace(
        still,
        hours=4000.0,
        observations=(*still.observations, *later),
        replacements=((2000.0, "friction"),),
    )
    learnt = [learning.hypotheses_of_unit(unit, Prior(), 0).hypotheses for unit in (still, wore, both)]
    constant = [np.mean(hypotheses.law[:, 0] == CONSTANT) for hypotheses in learnt]
    assert constant[0] > 0.7
    assert constant[1] < 0.1
    assert constant[2] == pytest.approx((constant[0] + constant[1]) / 2, abs=0.1)


@pytest.fixture
def history(tmp_path: Path) -> Iterator[History]:
    """Return a history of three usable units and a new unit, each with different cycles per hour."""
    with History.open(tmp_path / "history.sqlite", create=True) as opened:
        number = 0
        for i, (unit, flights) in enumerate((("S0", 3), ("S1", 4), ("S2", 3), ("new", 1))):
            for flight in range(1, flights + 1):
                number += 1
                entry = replace(made_up.entry(unit, 50.0 * flight), cycles=(37 + 9 * i) * flight + flight**2)
                opened.add(entry, made_up.recording(number), made_up.diagnosis(number))
        yield opened


def content(prior: Prior) -> tuple[object, ...]:
    """Return the content of a fleet's prior as values that can be compared."""
    assert prior.fleet is not None
    assert prior.fleet_pace is not None
    pace = prior.fleet_pace
    return (
        [hypotheses.tolist() for hypotheses in prior.fleet],
        (prior.fleet_share, prior.units, prior.reference, pace.reference, pace.exponents.tolist()),
        [fingerprint(evidence) for evidence in pace.units],
        None if prior.trajectories is None else prior.trajectories.change.tolist(),
    )


def test_the_fleet_prior_equals_the_prior_learnt_from_the_history(history: History) -> None:
    units = {unit.serial_number: Evidence.of(unit) for unit in history.units()}
    unrounded = StressReference.of([piece for unit in units.values() for piece in unit.stresses])
    for name in ("S0", "S1"):
        learnt = learnt_prior(history, history.unit(name), seed=3)
        from_fleet = fleet_prior(list(units.values()), unit=name, seed=3, actuator=made_up.THESIS)
        assert content(from_fleet) == content(learnt)
        assert from_fleet.reference == learnt.reference != unrounded
    others = [unit for name, unit in units.items() if name != "new"]
    learnt = learnt_prior(history, history.unit("new"), seed=3)
    assert content(fleet_prior(others, seed=3, actuator=made_up.THESIS)) == content(learnt)


def test_a_unit_that_gives_a_trajectory_and_a_pace_is_counted_once(fleet: list[Evidence]) -> None:
    three = fleet_prior(fleet[:3])
    assert three.units == 3
    assert learning.with_fleet_pace(three, [unit.unit for unit in fleet[:3]], fleet[1:]).units == len(fleet)


def test_a_unit_is_filtered_again_only_after_a_new_diagnosis(monkeypatch: pytest.MonkeyPatch) -> None:
    fleet = [flown(1.0, 1.0, i, upto=500.0) for i in range(3)]
    followed = []

    def counted(evidence: Evidence, *args: Any, **options: Any) -> Iterator[Moment]:
        followed.append(evidence.unit)
        return moments(evidence, *args, **options)

    monkeypatch.setattr(learning, "moments", counted)
    first = fleet_prior(fleet, seed=5)
    assert sorted(followed) == sorted(unit.unit for unit in fleet)
    again = fleet_prior([*fleet[1:], flown(1.0, 1.0, 0, upto=600.0)], seed=5)
    assert followed[len(fleet) :] == ["unit 0"]
    assert first.fleet is not None
    assert again.fleet is not None
    assert first.fleet.rate.shape == again.fleet.rate.shape
