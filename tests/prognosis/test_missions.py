"""Variation of the stress of units, and random future stress, against simulations and direct integration."""

import numpy as np
import pytest

from emaphm.prognosis import Stress, StressPiece, StressReference
from emaphm.prognosis.from_fleet.missions import FutureStress, Missions

REFERENCE = StressReference(load=1.0, temperature=290.0)


def flown(loads: np.ndarray) -> list[StressPiece]:
    """Return intervals of 10 h with these mean loads."""
    return [StressPiece(10.0 * i, 10.0 * (i + 1), Stress(load)) for i, load in enumerate(loads.tolist())]


def test_weight_and_variance_are_those_of_an_analysis_of_variance() -> None:
    random, fleet = np.random.default_rng(4), []
    for _ in range(300):
        loads = np.exp(0.1 * random.standard_normal() + 0.2 * random.standard_normal(12))
        temperatures = (290 + random.standard_normal(12)).tolist()
        fleet.append(
            [
                piece._replace(stress=Stress(piece.stress.load, temperature))
                for piece, temperature in zip(flown(loads), temperatures, strict=True)
            ]
        )
    missions = Missions.of(fleet, REFERENCE)
    load, temperature, cycles = missions.reference_weight
    assert load == pytest.approx(0.2**2 / 0.1**2, rel=0.3)
    # All units have the same mean temperature; no cycles were recorded.
    assert temperature > 20
    assert cycles == 0
    assert list(missions.variance) == pytest.approx([0.04, 0.01, 0.0], rel=0.1)
    assert missions.hours == 10
    assert Missions.of(fleet[:4], REFERENCE)[:2] == ((0, 0, 0), (0, 0, 0))


@pytest.mark.parametrize("count", [7, 10, 13])
def test_a_stress_that_never_changes_is_not_shrunk_by_rounding_errors(count: int) -> None:
    constant = Stress(load=123.4, temperature=293.15)
    fleet = [
        [StressPiece(100.0 * i, 100.0 * (i + 1), constant) for i in range(count + k % 3)] for k in range(8)
    ]
    missions = Missions.of(fleet, StressReference(load=120.0, temperature=293.0))
    assert missions == Missions(hours=100.0)


def test_the_future_stress_is_that_of_simulated_units_with_the_same_past() -> None:
    random, within, between, count = np.random.default_rng(1), 0.2, 0.1, 3
    mission = between * random.standard_normal(1_000_000)
    past = mission + within / np.sqrt(count) * random.standard_normal(mission.size)
    alike = mission[np.abs(past - 0.15) < 0.005]
    missions = Missions(((within / between) ** 2, 0.0, 0.0), (within**2, 0.0, 0.0), 10.0)
    pieces = flown(np.exp([0.05, 0.15, 0.25]))
    drawn = FutureStress.drawn(missions, pieces, REFERENCE, 30.0, None, 20_000, random)
    load = drawn.covariates[..., 0]
    assert load.mean() == pytest.approx(alike.mean(), abs=0.003)
    assert load.mean(axis=1).std() == pytest.approx(np.hypot(alike.std(), within / 10), rel=0.03)
    assert (load - load.mean(axis=1, keepdims=True)).std() == pytest.approx(within, rel=0.01)
    assert not drawn.covariates[..., 1:].any()


def test_a_mission_that_was_never_recorded_is_a_part_of_the_pace() -> None:
    missions = Missions((4.0, 4.0, 0.0), (0.04, 0.04, 0.0), 10.0)
    random = np.random.default_rng(3)
    drawn = FutureStress.drawn(missions, flown(np.ones(6)), REFERENCE, 60.0, None, 20_000, random)
    between_paths = drawn.covariates.mean(axis=1).std(axis=0)
    # The load has a mission's variance of 0.04 / 10 in addition to the mean of 100 intervals.
    assert between_paths[:2] == pytest.approx([np.hypot(0.2 / 10**0.5, 0.02), 0.02], rel=0.03)


def test_flight_hours_agree_with_an_integration_hour_by_hour() -> None:
    random = np.random.default_rng(2)
    covariates = 0.3 * random.standard_normal((4, 100, 3))
    exponents = np.array([3.0, 0.2, 0.0])
    ageing = np.array([0.0, 37.0, 333.3, 5_000.0])
    hours = FutureStress(covariates, 10.0).flight_hours(ageing, exponents)
    for path, end, hours_of_ageing in zip(covariates, hours, ageing, strict=True):
        rates = np.exp(path @ exponents)
        each_hour = np.concatenate([np.repeat(rates, 10), np.full(9_000, rates.mean())])
        whole = int(end)
        assert each_hour[:whole].sum() + (end - whole) * each_hour[whole] == pytest.approx(hours_of_ageing)
    assert np.isinf(FutureStress(covariates, 10.0).flight_hours(np.full(4, np.inf), exponents)).all()


def test_a_stated_stress_is_certain() -> None:
    missions = Missions((4.0, 4.0, 0.0), (0.04, 0.04, 0.0), 10.0)
    ahead, random = Stress(2.0, 300.0), np.random.default_rng(0)
    stress = FutureStress.drawn(missions, (), REFERENCE, 0.0, ahead, 5, random)
    hours = stress.flight_hours(np.full(5, 800.0), np.array([3.0, 0.0, 0.0]))
    assert hours == pytest.approx(np.full(5, 100.0))
