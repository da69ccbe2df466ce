"""Refinement by steps of the reference model, which ends where the residual is noise and switching."""

import numpy as np
import pytest

from cases import drawn
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.reference.refinement import RefinementSettings, refine_by_reference
from emaphm.estimation.search_result import EXPECTED_RESIDUAL, SearchResult

from .off_truth import objective_of, result_off

TRUTH = drawn(4, seed=7)[1]
FEW = RefinementSettings(iterations=4, replicates=4)


@pytest.fixture(scope="module")
def objective() -> MapObjective:
    return objective_of(TRUTH)


def result_at_distance(objective: MapObjective, distance: float) -> SearchResult:
    return result_off(objective, TRUTH, distance)


def test_the_refinement_leads_from_nearby_to_the_truth(objective: MapObjective) -> None:
    begun = result_at_distance(objective, 0.02)
    assert EXPECTED_RESIDUAL < begun.normalised_residual < FEW.farthest
    ended = refine_by_reference(begun, seed=0, settings=FEW)
    assert ended.normalised_residual <= EXPECTED_RESIDUAL
    assert ended.converged
    # The best identified components; backlash and eccentricity are confounded within the noise.
    well_identified = [0, 2, 3, 4, 7]
    deviation = np.abs(ended.point - objective.space.points(TRUTH))[well_identified]
    assert deviation.max() < 0.25 * 0.02
    # The correction makes the point the optimum: the corrected model has the residual of the reference model.
    np.testing.assert_array_equal(ended.correction, ended.outputs_correction)
    np.testing.assert_array_equal(ended.remaining_bias, 0.0)


def test_the_refinement_never_increases_the_misfit(objective: MapObjective) -> None:
    begun = result_at_distance(objective, 0.05)
    ended = refine_by_reference(begun, seed=0, settings=RefinementSettings(iterations=1, replicates=1))
    assert ended.misfit <= begun.reweighted().misfit


def test_an_expected_residual_is_not_refined(objective: MapObjective) -> None:
    result = result_at_distance(objective, 0.0)
    assert result.normalised_residual <= EXPECTED_RESIDUAL
    assert refine_by_reference(result, seed=0, settings=FEW) is result


def test_a_false_minimum_is_not_refined(objective: MapObjective) -> None:
    far = result_at_distance(objective, 0.3)
    assert far.normalised_residual > FEW.farthest
    assert refine_by_reference(far, seed=0, settings=FEW) is far


def test_the_same_seed_gives_the_same_bits(objective: MapObjective) -> None:
    once = RefinementSettings(iterations=1, replicates=2)
    first, second = (
        refine_by_reference(result_at_distance(objective, 0.02), seed=4, settings=once) for _ in range(2)
    )
    np.testing.assert_array_equal(first.point, second.point)
