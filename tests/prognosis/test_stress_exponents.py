"""Exponents of the stress from a fleet: regression over the intervals of a unit, and population of units."""

import numpy as np
import pytest

from emaphm.arrays import Array
from emaphm.prognosis import Evidence, Observation
from emaphm.prognosis.from_fleet.stress_exponents import (
    ExponentEstimates,
    exponents_of_new_unit,
    exponents_of_unit,
)
from emaphm.prognosis.settings import DEGRADATION
from emaphm.prognosis.stress import Stress, StressPiece, StressReference

RANGES = DEGRADATION.exponents
REFERENCE = StressReference(load=0.1, temperature=290.0)
LOWEST, HIGHEST = np.array(RANGES).T
FILTERED = np.random.default_rng(8).uniform(LOWEST, HIGHEST, (4000, 8, 3))
"""Draws from filters without information: the general prior."""

LOAD, TEMPERATURE = 3.0, 0.17
"""True exponents of the units below."""


def unit(seed: int, growth: float, error: float = 1e-4, count: int = 25) -> Evidence:
    """Return a unit whose friction x follows dx/da = r (1 + growth x) in its hours of ageing a, to 0.5."""
    random = np.random.default_rng(seed)
    load, temperature = 0.1 * random.uniform(0.8, 1.25, count), random.uniform(275.0, 305.0, count)
    step = 100.0 * (load / 0.1) ** LOAD * np.exp(TEMPERATURE * (temperature - 290.0) / 10)
    end = np.cumsum(step) / step.sum()
    level = 0.5 * (np.expm1(growth * end) / np.expm1(growth) if growth else end)
    level = level + error * random.standard_normal(count)
    hours = 100.0 * np.arange(1, count + 1)
    observations = [
        Observation(float(at), np.eye(8)[0] * x, error**2 * np.eye(8), np.ones(8, bool))
        for at, x in zip(hours, level, strict=True)
    ]
    pieces = [
        StressPiece(float(at) - 100.0, float(at), Stress(*stress))
        for at, *stress in zip(hours, load, temperature, strict=True)
    ]
    return Evidence(f"unit-{seed}", "part", float(hours[-1]), tuple(observations), stresses=tuple(pieces))


def estimates(mean: Array, precision: float) -> list[ExponentEstimates]:
    """Return estimates of units with the same `mean` (n,) and precision of all exponents."""
    return [ExponentEstimates(np.full((8, 3), one), np.full((8, 3), precision)) for one in mean]


@pytest.mark.parametrize("growth", [0.0, 3.0])
def test_the_exponents_of_a_unit_do_not_depend_on_its_law(growth: float) -> None:
    mean, precision = exponents_of_unit(unit(1, growth), REFERENCE, RANGES)
    assert mean[0, :2] == pytest.approx([LOAD, TEMPERATURE], rel=0.1)
    assert (precision[0, :2] ** -0.5 < [0.35, 0.04]).all()
    # No cycles were recorded, and the other components do not degrade.
    assert precision[0, 2] == 0
    assert not precision[1:].any()


def test_the_standard_errors_of_exponents_are_those_of_many_units() -> None:
    deviations = []
    for seed in range(60):
        mean, precision = exponents_of_unit(unit(seed, 1.0, error=2e-3), REFERENCE, RANGES)
        deviations.append((mean[0, :2] - [LOAD, TEMPERATURE]) * np.sqrt(precision[0, :2]))
    # With 60 units, a mean has a standard error of 0.13, a standard deviation one of 0.09.
    assert np.mean(deviations, axis=0) == pytest.approx([0.0, 0.0], abs=0.4)
    assert np.std(deviations, axis=0) == pytest.approx([0.9, 0.9], abs=0.3)


def test_an_onset_of_degradation_is_not_taken_for_stress() -> None:
    late = unit(2, 0.0)
    waiting = [
        Observation(one.hours, np.zeros(8), one.covariance, one.seen) if i < 8 else one
        for i, one in enumerate(late.observations)
    ]
    changed = Evidence("late", "part", late.hours, tuple(waiting), stresses=late.stresses)
    mean, precision = exponents_of_unit(changed, REFERENCE, RANGES)
    assert mean[0, :2] == pytest.approx([LOAD, TEMPERATURE], rel=0.1)
    assert (precision[0, :2] ** -0.5 < [0.4, 0.04]).all()


def test_a_new_unit_has_the_mean_and_the_spread_of_the_fleet() -> None:
    true = np.random.default_rng(5).normal(2.5, 0.4, 60)
    drawn = exponents_of_new_unit(estimates(true, 1 / 0.05**2), FILTERED, RANGES, np.random.default_rng(6))
    assert drawn[:, 0, 0].mean() == pytest.approx(true.mean(), abs=0.05)
    assert drawn[:, 0, 0].std() == pytest.approx(0.4, rel=0.25)


def test_a_fleet_without_information_has_the_general_prior() -> None:
    drawn = exponents_of_new_unit(estimates(np.zeros(30), 0.0), FILTERED, RANGES, np.random.default_rng(6))
    for k, (low, high) in enumerate(RANGES):
        assert drawn[:, 0, k].mean() == pytest.approx((low + high) / 2, abs=0.03 * (high - low))
        assert drawn[:, 0, k].std() == pytest.approx((high - low) / np.sqrt(12), rel=0.05)


def test_a_wrong_estimate_of_one_unit_hardly_changes_the_fleet() -> None:
    right = estimates(np.full(10, 3.0), 1 / 0.3**2)
    wrong = [*right, *estimates(np.zeros(1), 1 / 0.05**2)]
    means = [
        exponents_of_new_unit(units, FILTERED, RANGES, np.random.default_rng(6))[:, 0, 0].mean()
        for units in (right, wrong)
    ]
    assert means == pytest.approx([3.0, 3.0], abs=0.15)


def test_one_unit_leaves_the_exponents_of_another_uncertain() -> None:
    drawn = exponents_of_new_unit(estimates(np.full(1, 3.0), 1e4), FILTERED, RANGES, np.random.default_rng(6))
    low, median, high = np.quantile(drawn[:, 0, 0], [0.05, 0.5, 0.95])
    assert low < 2.2
    assert median == pytest.approx(3.0, abs=0.2)
    assert high > 3.6


def test_the_filters_of_the_units_are_used_where_they_know_more() -> None:
    filtered = np.random.default_rng(9).normal(1.0, 0.2, FILTERED.shape)
    drawn = exponents_of_new_unit(estimates(np.full(2, 3.0), 0.5), filtered, RANGES, np.random.default_rng(6))
    assert (drawn[..., 0] == filtered[..., 0]).all()


def test_several_recordings_of_a_flight_count_as_one_diagnosis() -> None:
    once = unit(3, 1.0, error=2e-3)
    random = np.random.default_rng(4)
    repeated = [
        Observation(one.hours, one.level + 2e-3 * random.standard_normal(8), one.covariance, one.seen)
        for one in once.observations
        for _ in range(2)
    ]
    twice = Evidence("twice", "part", once.hours, tuple(repeated), stresses=once.stresses)
    with np.errstate(all="raise"):
        mean, precision = exponents_of_unit(twice, REFERENCE, RANGES)
    assert (abs(mean[0, :2] - [LOAD, TEMPERATURE]) < 3 * precision[0, :2] ** -0.5).all()
    assert (precision[0, :2] ** -0.5 < [0.9, 0.12]).all()
