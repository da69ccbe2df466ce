"""Steps by the reference model itself: they end where its residual is noise and switching."""

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


def away(objective: MapObjective, distance: float) -> SearchResult:
    return result_off(objective, TRUTH, distance)


def test_it_leads_from_nearby_to_the_truth(objective: MapObjective) -> None:
    begun = away(objective, 0.02)
    assert EXPECTED_RESIDUAL < begun.normalised_residual < FEW.farthest
    ended = refine_by_reference(begun, seed=0, settings=FEW)
    assert ended.normalised_residual <= EXPECTED_RESIDUAL
    assert ended.converged
    # What the current shows best; backlash and eccentricity may stand for each other until noise tells them.
    shown = [0, 2, 3, 4, 7]
    off = np.abs(ended.point - objective.space.points(TRUTH))[shown]
    assert off.max() < 0.25 * 0.02
    # The correction under which the point is the optimum: that model's residual is the reference model's.
    np.testing.assert_array_equal(ended.correction, ended.outputs_correction)
    np.testing.assert_array_equal(ended.remaining_bias, 0.0)


def test_a_residual_is_never_larger_than_before(objective: MapObjective) -> None:
    begun = away(objective, 0.05)
    ended = refine_by_reference(begun, seed=0, settings=RefinementSettings(iterations=1, replicates=1))
    assert ended.misfit <= begun.reweighted().misfit


def test_what_is_explained_already_stays(objective: MapObjective) -> None:
    result = away(objective, 0.0)
    assert result.normalised_residual <= EXPECTED_RESIDUAL
    assert refine_by_reference(result, seed=0, settings=FEW) is result


def test_a_false_minimum_is_left_to_a_new_search(objective: MapObjective) -> None:
    far = away(objective, 0.3)
    assert far.normalised_residual > FEW.farthest
    assert refine_by_reference(far, seed=0, settings=FEW) is far


def test_the_same_seed_gives_the_same_bits(objective: MapObjective) -> None:
    once = RefinementSettings(iterations=1, replicates=2)
    first, second = (refine_by_reference(away(objective, 0.02), seed=4, settings=once) for _ in range(2))
    np.testing.assert_array_equal(first.point, second.point)
