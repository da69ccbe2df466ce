"""The prior from other units: their trajectories, on whose time scale, and by how much units differ."""

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


def bent(hours: Array | float) -> Array:
    """Return a level that saturates, by none of the filter's laws."""
    return np.asarray(0.7 / (1 + np.exp(-(np.asarray(hours) - 900.0) / 180.0)))


def trajectory(level: Array) -> Trajectory:
    levels = np.tile(NEW, (HOURS.size, 1))
    levels[:, 0] = level
    return Trajectory(HOURS, np.tile(HOURS[:, np.newaxis], 8), levels, np.zeros(8), np.full(8, np.inf), NEW)


def test_a_component_follows_the_trajectory_of_another_unit_on_its_own_time_scale() -> None:
    trajectories = ReferenceTrajectories.of([trajectory(np.zeros(HOURS.size)), trajectory(bent(HOURS))])
    law, unit = np.full((1, 8), AS_ANOTHER, np.int8), np.ones((1, 8))
    scale = np.full((1, 8), 4000.0)  # twice the time of the other one
    for age, step in ((200.0, 300.0), (1500.0, 900.0), (100.0, 3800.0)):
        reach, growth = transition(law, scale, unit, np.full((1, 8), age), step, DEGRADATION, trajectories)
        # Amplitude 1, so a rate of 1/T; the other unit is interpolated at 65 points.
        expected = bent((age + step) / 2) - bent(age / 2)
        assert reach[0, 0] / 4000.0 == pytest.approx(expected, abs=2e-3)
        assert growth[0, 0] == 1.0
        assert reach[0, 1] == pytest.approx(0.0)


def test_a_trajectory_is_extrapolated_straight_or_as_a_power_with_equal_probability() -> None:
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


def test_a_trajectory_that_is_straight_or_constant_is_extrapolated_straight_in_either_form() -> None:
    where = np.zeros(2, int)
    for level in (3e-4 * HOURS, np.zeros(HOURS.size)):
        found = ReferenceTrajectories.of([trajectory(level)]).change_at(
            np.array([0, 1]), np.full(2, 1.5), where
        )
        assert found == pytest.approx([1.5 * level[-1]] * 2, rel=1e-6)


def test_each_life_of_a_component_is_a_trajectory_of_its_own() -> None:
    first, later = np.arange(8) == 0, HOURS[:, np.newaxis] > 1200.0
    levels = trajectory(bent(HOURS)).level
    levels[HOURS > 1200.0, 0] = 1e-4 * (HOURS[HOURS > 1200.0] - 1200.0)
    age = np.where(first & later, HOURS[:, np.newaxis] - 1200.0, HOURS[:, np.newaxis])
    new_at = np.where(first, [[0.0], [1200.0]], [[0.0], [np.inf]])
    until = np.where(first, [[1200.0], [np.inf]], np.inf)
    found = ReferenceTrajectories.of(
        [Trajectory(HOURS, age, levels, *ends, NEW) for ends in zip(new_at, until, strict=True)]
    )
    # Each trajectory twice, by its extrapolation.
    assert found.span[:, 0].tolist() == [1200.0, 800.0] * 2
    assert found.span[:, 1:].tolist() == [[2000.0] * 7, [0.0] * 7] * 2
    assert found.change[0, 0, -1] == pytest.approx(bent(1200.0))
    assert found.change[1, 0, -1] == pytest.approx(0.08)


def test_copies_differ_again_without_widening() -> None:
    random = np.random.default_rng(0)
    values = np.exp(random.normal([[1.0, 5.0]], [[0.3, 0.6]], (4000, 2)))
    kinds = kinds_of(np.zeros(values.shape, int), np.ones(2, bool))
    after = np.log(apart_again(values, kinds, FilterSettings(), random))
    assert after.mean(axis=0) == pytest.approx(np.log(values).mean(axis=0), abs=0.02)
    assert after.std(axis=0) == pytest.approx([0.3, 0.6], rel=0.04)
    assert np.abs(after - np.log(values)).min() > 0


def flown(time: float, amplitude: float, seed: int, upto: float = 2000.0, every: float = 100.0) -> Evidence:
    """Return diagnoses of a unit whose friction follows the bent trajectory, in a multiple of its time."""
    random = np.random.default_rng(seed)
    observations = []
    for hours in np.arange(every, upto + 1, every):
        level = NEW + 0.005 * random.standard_normal(8)
        level[0] += amplitude * bent(hours / time)
        observations.append(Observation(float(hours), level, 0.005**2 * np.eye(8), np.ones(8, bool)))
    return Evidence(f"unit {seed}", "part", upto, tuple(observations))


def hastened(unit: Evidence, factor: float) -> Evidence:
    """Return a unit to which all happens in the hours over `factor`."""
    observations = tuple(replace(one, hours=one.hours / factor) for one in unit.observations)
    return replace(unit, hours=unit.hours / factor, observations=observations)


@pytest.fixture(scope="module")
def fleet() -> list[Evidence]:
    times = np.exp(0.2 * np.random.default_rng(1).standard_normal(4))
    return [flown(float(time), 1.0, i, every=200.0) for i, time in enumerate(times)]


def test_a_new_unit_is_believed_to_follow_the_trajectories_of_its_fleet(fleet: list[Evidence]) -> None:
    prior = fleet_prior(fleet)
    belief = follow(flown(0.9, 1.0, 99, upto=1200.0, every=200.0), prior).belief
    assert belief.law_probabilities()[0, AS_ANOTHER] > 0.7
    assert belief.law_probabilities()[0].sum() == pytest.approx(1.0)


def test_units_that_live_for_a_hundred_hours_give_a_prior_of_such_lives(fleet: list[Evidence]) -> None:
    """All hours a twentieth: the time of the others' trajectories is below the least life scale of a law."""
    prior = fleet_prior([hastened(one, 20.0) for one in fleet[:3]])
    belief = follow(hastened(flown(0.9, 1.0, 99, upto=1200.0, every=200.0), 20.0), prior).belief
    as_others = belief.law[:, 0] == AS_ANOTHER
    assert belief.law_probabilities()[0, AS_ANOTHER] > 0.7
    assert np.median(belief.life_scale[as_others, 0]) == pytest.approx(0.9 * 2000.0 / 20.0, rel=0.3)


def test_what_a_shop_replaces_after_a_failure_takes_no_hypotheses_of_that_life_away() -> None:
    """A unit that failed at 1,200 h, and the same one repaired, that flew on with a new friction since."""
    failed = replace(flown(1.0, 1.0, 3, upto=1200.0, every=200.0), failures=(1200.0,))
    repaired = replace(failed, replacements=((1200.0, "friction"),))
    later = [replace(one, hours=one.hours + 1200.0) for one in flown(1.0, 1.0, 4, upto=200.0).observations]
    flies = replace(repaired, hours=1400.0, observations=(*failed.observations, *later))
    once, repaired_once, again = (
        learning.hypotheses_of_unit(one, Prior(), 0) for one in (failed, repaired, flies)
    )
    for other in (repaired_once, again):
        assert np.array_equal(other.trajectories[0].level[:6], once.trajectories[0].level)
        moving = [np.mean(one.hypotheses.law[:, 0] != CONSTANT) for one in (once, other)]
        assert moving[1] == pytest.approx(moving[0], abs=0.1)
        rates = [np.median(np.abs(one.hypotheses.rate[:, 0])) for one in (once, other)]
        assert rates[1] == pytest.approx(rates[0], rel=0.3)
    # Two diagnoses of the second life make no trajectory.
    spans = [ReferenceTrajectories.of(one.trajectories).span for one in (once, again)]
    assert spans[1][:2, 0].tolist() == [spans[0][0, 0], 0.0]


def test_two_lives_of_a_component_give_half_of_the_hypotheses_each() -> None:
    """In the first one the component stood still, in the second it wore."""
    still, wore = (flown(1.0, amplitude, seed, every=200.0) for amplitude, seed in ((0.0, 5), (1.0, 6)))
    later = [replace(one, hours=one.hours + 2000.0) for one in wore.observations]
    both = replace(
        still,
        hours=4000.0,
        observations=(*still.observations, *later),
        replacements=((2000.0, "friction"),),
    )
    hypotheses = [learning.hypotheses_of_unit(one, Prior(), 0).hypotheses for one in (still, wore, both)]
    constant = [np.mean(one.law[:, 0] == CONSTANT) for one in hypotheses]
    assert constant[0] > 0.7
    assert constant[1] < 0.1
    assert constant[2] == pytest.approx((constant[0] + constant[1]) / 2, abs=0.1)


@pytest.fixture
def history(tmp_path: Path) -> Iterator[History]:
    """Return a history of three usable units and a new one, each with other cycles per hour."""
    with History.open(tmp_path / "history.sqlite", create=True) as found:
        number = 0
        for i, (unit, flights) in enumerate((("S0", 3), ("S1", 4), ("S2", 3), ("new", 1))):
            for flight in range(1, flights + 1):
                number += 1
                entry = replace(made_up.entry(unit, 50.0 * flight), cycles=(37 + 9 * i) * flight + flight**2)
                found.add(entry, made_up.recording(number), made_up.diagnosis(number))
        yield found


def said(prior: Prior) -> tuple[object, ...]:
    """Return what a prior says, in values that can be compared."""
    assert prior.fleet is not None
    assert prior.fleet_pace is not None
    pace = prior.fleet_pace
    return (
        [one.tolist() for one in prior.fleet],
        (prior.fleet_share, prior.units, prior.reference, pace.reference, pace.exponents.tolist()),
        [fingerprint(one) for one in pace.units],
        None if prior.trajectories is None else prior.trajectories.change.tolist(),
    )


def test_a_fleets_prior_is_the_one_that_a_unit_of_the_history_gets(history: History) -> None:
    units = {one.serial_number: Evidence.of(one) for one in history.units()}
    reference = StressReference.of([piece for one in units.values() for piece in one.stresses])
    for name in ("S0", "S1"):
        learnt = learnt_prior(history, history.unit(name), seed=3)
        found = fleet_prior(list(units.values()), unit=name, seed=3, actuator=made_up.THESIS)
        assert said(found) == said(learnt)
        assert found.reference == learnt.reference != reference  # which is not rounded
    others = [one for name, one in units.items() if name != "new"]
    learnt = learnt_prior(history, history.unit("new"), seed=3)
    assert said(fleet_prior(others, seed=3, actuator=made_up.THESIS)) == said(learnt)


def test_units_that_are_followed_and_give_a_pace_count_once(fleet: list[Evidence]) -> None:
    three = fleet_prior(fleet[:3])
    assert three.units == 3
    assert learning.with_fleet_pace(three, [one.unit for one in fleet[:3]], fleet[1:]).units == len(fleet)


def test_a_unit_is_followed_once_until_it_is_diagnosed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    fleet = [flown(1.0, 1.0, i, upto=500.0) for i in range(3)]
    seen = []

    def counted(evidence: Evidence, *args: Any, **options: Any) -> Iterator[Moment]:
        seen.append(evidence.unit)
        return moments(evidence, *args, **options)

    monkeypatch.setattr(learning, "moments", counted)
    first = fleet_prior(fleet, seed=5)
    assert sorted(seen) == sorted(one.unit for one in fleet)
    again = fleet_prior([*fleet[1:], flown(1.0, 1.0, 0, upto=600.0)], seed=5)
    assert seen[len(fleet) :] == ["unit 0"]
    assert first.fleet is not None
    assert again.fleet is not None
    assert first.fleet.rate.shape == again.fleet.rate.shape
