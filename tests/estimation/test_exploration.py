"""Exploration where a heavy current hides false minima, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from cases import drawn
from emaphm.estimation.bias_correction import with_discrepancy
from emaphm.estimation.global_search.exploration import (
    ExplorationSettings,
    explore,
    is_better,
    is_clear,
    is_heavy,
)
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import EXPLAINED_RESIDUAL, SearchResult

from .off_truth import objective_of, result_off

HEAVY = np.array([0.6, 0.3, 0.8, 0.75, 0.7, 0.5, 0.3, 0.4])
FEW = ExplorationSettings(iterations=2, moves=8)


@pytest.fixture(scope="module")
def objective() -> MapObjective:
    return objective_of(HEAVY)


def near(objective: MapObjective, distance: float) -> SearchResult:
    return result_off(objective, HEAVY, distance)


def test_it_leads_to_a_smaller_misfit_and_states_what_it_has_seen(objective: MapObjective) -> None:
    begun = near(objective, 0.02)
    ended = explore(begun, seed=0, settings=FEW)
    assert is_better(ended, begun)
    assert not is_better(begun, ended)
    assert np.all(np.diag(ended.scatter) >= np.diag(begun.scatter))
    np.testing.assert_array_equal(ended.remaining_bias, 0.0)
    assert ended.converged


def test_the_same_seed_gives_the_same_bits(objective: MapObjective) -> None:
    once = replace(FEW, iterations=1)
    first, second = (explore(near(objective, 0.02), seed=4, settings=once) for _ in range(2))
    np.testing.assert_array_equal(first.point, second.point)


def test_a_residual_that_the_share_of_a_heavy_current_hides_is_not_clear(objective: MapObjective) -> None:
    assert is_heavy(objective.problem)
    hidden = near(objective, 1e-4)
    assert hidden.down_to_noise
    assert hidden.residual_over_switching > EXPLAINED_RESIDUAL
    assert not is_clear(hidden)


def test_other_recordings_are_clear_whatever_is_left() -> None:
    light = objective_of(drawn(1, seed=7)[0])
    assert not is_heavy(light.problem)
    assert is_clear(with_discrepancy(SearchResult.at(light, light.space.points(HEAVY)), seed=0))
