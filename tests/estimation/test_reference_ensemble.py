"""Ensembles of the reference model: they leave false minima caused by heavy currents."""

from dataclasses import replace

import numpy as np
import pytest

from cases import drawn
from emaphm.estimation.bias_correction import with_discrepancy
from emaphm.estimation.global_search.heavy_current import is_heavy, leaves_switching_alone
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.reference.ensemble import EnsembleSettings, first_factor, refine_by_ensemble
from emaphm.estimation.search_result import EXPECTED_RESIDUAL, SearchResult

from .off_truth import objective_of, result_off

HEAVY = np.array([0.6, 0.3, 0.8, 0.75, 0.7, 0.5, 0.3, 0.4])
FEW = EnsembleSettings(patience=2)


@pytest.fixture(scope="module")
def objective() -> MapObjective:
    return objective_of(HEAVY, duration=0.25)


def near(objective: MapObjective, distance: float) -> SearchResult:
    return result_off(objective, HEAVY, distance)


def test_the_ensemble_leads_from_a_false_minimum_to_the_truth(objective: MapObjective) -> None:
    begun = near(objective, 0.02)
    assert begun.residual_over_switching > 30
    ended = refine_by_ensemble(begun, seed=0, settings=FEW)
    assert leaves_switching_alone(ended)
    assert ended.converged
    # The best identified components; backlash and eccentricity are confounded within the noise.
    well_identified = [0, 2, 3, 4, 7]
    assert np.abs(ended.point - objective.space.points(HEAVY))[well_identified].max() < 0.1 * 0.02
    # The correction makes the point the optimum: the corrected model has the residual of the reference model.
    np.testing.assert_array_equal(ended.remaining_bias, 0.0)
    assert np.all(np.diag(ended.scatter) >= np.diag(begun.scatter))


@pytest.mark.parametrize("spread", [1.0, 1e12])
def test_the_first_spread_is_that_of_the_posterior_for_any_condition_number(spread: float) -> None:
    rng = np.random.default_rng(3)
    deviations = np.array([0.3, 1.0, 40.0, 0.02])
    axes = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    known = np.array([0.0, 1.0, spread, spread])
    factor = first_factor((axes * known @ axes.T) / np.outer(deviations, deviations), deviations)
    # In units of the prior along each axis; it is 1 along an axis without information.
    variances = np.diag(axes.T @ (factor @ factor.T / np.outer(deviations, deviations)) @ axes)
    np.testing.assert_allclose(variances, 1 / (1 + known), rtol=1e-3, atol=1e-3)
    # The spread is finite even where rounding removes the smallest information.
    assert np.isfinite(first_factor((axes * (1e28 * known) @ axes.T), deviations)).all()


def test_points_stay_in_the_space(objective: MapObjective) -> None:
    space = objective.space
    corner = with_discrepancy(SearchResult.at(objective, space.project(np.ones(space.dimensions))), seed=0)
    ended = refine_by_ensemble(corner, seed=0, settings=replace(FEW, generations=1))
    np.testing.assert_array_equal(ended.point, space.project(ended.point))


def test_the_same_seed_gives_the_same_bits(objective: MapObjective) -> None:
    once = replace(FEW, generations=1)
    first, second = (refine_by_ensemble(near(objective, 0.02), seed=4, settings=once) for _ in range(2))
    np.testing.assert_array_equal(first.point, second.point)


def test_a_residual_small_relative_to_a_heavy_current_exceeds_switching() -> None:
    objective = objective_of(HEAVY)
    assert is_heavy(objective.problem)
    hidden = near(objective, 1e-4)
    assert hidden.down_to_noise
    assert hidden.residual_over_switching > EXPECTED_RESIDUAL
    assert not leaves_switching_alone(hidden)


def test_the_current_of_a_light_fault_is_not_heavy() -> None:
    assert not is_heavy(objective_of(drawn(1, seed=7)[0]).problem)
