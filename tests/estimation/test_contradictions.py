"""Contradictions between recordings: a single outlier is set aside, recordings in equal numbers are not."""

import numpy as np

from emaphm.estimation.joint.contradictions import contradictions_of_most
from emaphm.estimation.joint.random_effects import random_effects
from emaphm.estimation.joint.uncertainty import AloneEstimates

PRIORS = np.full(2, 3.0)


def estimates(points: np.ndarray, deviations: np.ndarray) -> AloneEstimates:
    covariances = np.array([np.diag(deviation**2) for deviation in deviations])
    return AloneEstimates(
        points, covariances, np.ones(len(points)), random_effects(points, covariances, PRIORS)
    )


def test_one_outlier_of_four_does_not_determine_the_error_of_the_mean() -> None:
    rng = np.random.default_rng(0)
    deviations = np.full((4, 2), 0.01)
    deviations[2, 0] = 0.06
    for _ in range(30):
        points = rng.normal(0.0, deviations)
        points[2, 0] += 2.3  # a factor of ten
        contradictions = contradictions_of_most(estimates(points, deviations), PRIORS)
        assert contradictions.set_aside[2].tolist() == [True, False]
        assert not contradictions.set_aside[[0, 1, 3]].any()
        assert not contradictions.contradicted[0]
        # The shift of a weighted mean by the outlier remains: 2.3 times its share of the weights.
        weights = deviations[:, 0] ** -2
        pull = weights[2] / weights.sum() * (points[2, 0] - np.average(points[[0, 1, 3], 0]))
        assert pull**2 <= contradictions.covariance[0, 0] * (1 + 1e-9)
        assert contradictions.covariance[0, 0] < 0.1**2


def test_no_recording_is_set_aside_where_as_many_contradict_it_as_agree() -> None:
    for values in ([0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.01, 1.0, 1.01]):
        points = np.stack([values, np.zeros(len(values))], axis=1)
        contradictions = contradictions_of_most(estimates(points, np.full(points.shape, 0.01)), PRIORS)
        assert not contradictions.set_aside.any()
        assert contradictions.contradicted.tolist() == [True, False]
        assert contradictions.covariance[0, 0] >= np.var(values, ddof=1)


def test_estimates_that_scatter_by_their_errors_are_not_set_aside() -> None:
    rng = np.random.default_rng(1)
    any_set_aside = [
        contradictions_of_most(
            estimates(rng.normal(0.0, 0.05, (5, 2)), np.full((5, 2), 0.05)), PRIORS
        ).set_aside.any()
        for _ in range(150)
    ]
    # A probability of 0.001 for each of two parameters: three or more of 150 have a probability of 0.4 %.
    assert sum(any_set_aside) <= 2
