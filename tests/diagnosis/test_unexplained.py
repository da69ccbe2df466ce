"""Intervals of estimates that do not explain their recording: by the residual and by alternatives."""

from dataclasses import replace

import numpy as np
import pytest

from cases import HEALTHY, THESIS, reference_recordings
from emaphm.diagnosis.explanation.unexplained import alternatives_covariance, inflation, unexplained_scores
from emaphm.diagnosis.identifiability import identifiability
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult

FRICTION, BACKLASH = 0, 1


@pytest.fixture(scope="module")
def result() -> SearchResult:
    """Return the healthy estimate of a recording with a friction fault of 0.3."""
    faulty = np.array(HEALTHY)
    faulty[FRICTION] = 0.3
    recording = reference_recordings([faulty], noise=0.05)[0]
    objective = faults_objective(problem_of(recording, THESIS, channels=None), ("load",))
    return SearchResult.at(objective, objective.space.points(HEALTHY))


def shifted(result: SearchResult, friction: float, factor: float) -> SearchResult:
    """Return an alternative whose friction is larger by `friction`, and its residual by about `factor`."""
    point = result.point.copy()
    point[FRICTION] += friction
    return replace(result, point=point, known_outputs=result.objective.target - factor * result.residual)


def test_the_bound_on_scores_holds_for_errors_of_the_size_of_the_residual(result: SearchResult) -> None:
    rows = result.objective.channel_rows
    rng = np.random.default_rng(5)
    jacobian = rng.normal(size=(2, rows))
    bound = unexplained_scores(result, jacobian)
    residual = result.residual[:rows]
    # Circular shifts of the residual have exactly its spectrum, and any phase relative to the Jacobian.
    scores = np.array([jacobian @ np.roll(residual, k) for k in range(0, rows, 7)])
    assert np.all(scores.var(axis=0) <= np.diag(bound))


def test_an_explained_covariance_is_not_inflated(result: SearchResult) -> None:
    assert inflation(result, explained=True) == 1.0
    assert inflation(result, explained=False) == pytest.approx(result.normalised_residual**2)
    # A converged search has no further step, which both covariances would include.
    end = replace(result, converged=True)
    explained, unexplained = (
        np.diag(identifiability(end, seed=0, explained=flag).covariance - end.scatter)
        for flag in (True, False)
    )
    assert np.all(unexplained >= result.normalised_residual**2 * explained * (1 - 1e-9))


def test_only_alternatives_that_fit_equally_well_widen_the_covariance(result: SearchResult) -> None:
    none = alternatives_covariance(result, explained=False)
    assert none == 0.0
    near, far = shifted(result, 0.2, 1.2), shifted(result, 0.4, 2.0)
    added = alternatives_covariance(replace(result, alternatives=(near, far)), explained=False)
    # Student's t of one degree of freedom over the normal quantile: 12.706 / 1.960.
    assert np.asarray(added)[FRICTION, FRICTION] == pytest.approx((0.2 * 12.706 / 1.960) ** 2, rel=1e-3)
    assert np.asarray(added)[BACKLASH, BACKLASH] == 0.0
    # None of the alternatives explains the recording.
    assert alternatives_covariance(replace(result, alternatives=(near, far)), explained=True) == 0.0
