"""Corrected Gauss-Newton steps: they end at the truth, or state that they have not converged."""

import numpy as np
import pytest

from cases import drawn
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.reference.corrected_steps import CORRECTED_STEPS, correct_by_steps

from .off_truth import objective_of

TRUTH = drawn(4, seed=7)[1]


@pytest.fixture(scope="module")
def objective() -> MapObjective:
    return objective_of(TRUTH)


def test_the_steps_lead_from_nearby_to_the_truth_with_few_runs(objective: MapObjective) -> None:
    truth = objective.space.points(TRUTH)
    begun = objective.space.project(truth + 0.02 * np.resize([1.0, -1.0], truth.size))
    _, before = objective.problem.runs.of(objective.problem.model)
    ended = correct_by_steps(objective, begun, CORRECTED_STEPS.most, seed=0)
    assert ended.converged
    assert ended.down_to_noise
    assert objective.problem.runs.of(objective.problem.model)[1] - before <= 4 * 16
    # The best identified components; backlash and eccentricity are confounded within the noise.
    well_identified = [0, 2, 3, 4, 7]
    assert np.abs(ended.point - truth)[well_identified].max() < 0.25 * 0.02


def test_a_single_step_from_afar_has_not_converged(objective: MapObjective) -> None:
    far = objective.space.project(objective.space.points(TRUTH) + 0.2)
    ended = correct_by_steps(objective, far, 1, seed=0)
    assert not ended.converged
    assert np.linalg.norm(ended.point - far) <= 2 * CORRECTED_STEPS.longest
