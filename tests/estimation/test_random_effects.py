"""Combined estimates of several recordings, against closed forms of weighted means and against draws."""

import numpy as np
import pytest

from emaphm.arrays import Array
from emaphm.estimation.joint.random_effects import random_effects

WEAK = np.full(2, 3.0)
"""Standard deviations of a prior too weak to affect the estimates below."""


def with_prior(covariance: Array) -> Array:
    """Return a covariance that includes the weak prior, like the covariance of each recording."""
    p = len(covariance)
    return np.asarray(np.linalg.inv(np.linalg.inv(covariance) + np.eye(p) / 9.0))


def test_a_single_estimate_is_unchanged() -> None:
    covariance = np.array([[4e-4, 1e-4], [1e-4, 9e-4]])
    combined = random_effects(np.array([[0.1, -0.2]]), with_prior(covariance)[np.newaxis], WEAK)
    # The prior, a hundred times as wide, changes the estimate by a ten-thousandth.
    np.testing.assert_allclose(combined.mean, [0.1, -0.2], rtol=1e-3)
    np.testing.assert_allclose(combined.covariance, covariance, rtol=1e-3)
    assert combined.birge_ratio is None


def test_two_estimates_are_weighted_by_their_precision() -> None:
    # 1/0.01² and 1/0.02²: weights 4 to 1, precision 12,500; the difference is less than the expected scatter.
    given = np.array([[0.100], [0.110]])
    combined = random_effects(
        given, np.array([with_prior(np.array([[s**2]])) for s in (0.01, 0.02)]), np.array([3.0])
    )
    assert combined.mean[0] == pytest.approx((4 * 0.100 + 0.110) / 5, rel=1e-4)
    assert combined.covariance[0, 0] == pytest.approx(1 / 12_500, rel=1e-4)
    assert combined.birge_ratio == pytest.approx(0.01 / np.hypot(0.01, 0.02), rel=1e-3)


def test_recordings_complement_each_other() -> None:
    sum_identified = np.linalg.inv(1e4 * np.array([[1.0, 1.0], [1.0, 1.0]]) + np.eye(2) / 9.0)
    first_identified = np.linalg.inv(np.diag([1e4, 0.0]) + np.eye(2) / 9.0)
    # Unidentified directions may have any value: here 5 along the difference, 7 in the second parameter.
    given = np.array([[0.1 + 5.0, 0.2 - 5.0], [0.1, 7.0]])
    combined = random_effects(given, np.array([sum_identified, first_identified]), WEAK)
    np.testing.assert_allclose(combined.mean, [0.1, 0.2], atol=1e-3)
    # Var(second) = Var(sum) + Var(first).
    np.testing.assert_allclose(np.diag(combined.covariance), [1e-4, 2e-4], rtol=1e-3)
    assert combined.birge_ratio is None


def test_a_parameter_that_no_recording_identifies_has_the_prior_once() -> None:
    first_identified = np.linalg.inv(np.diag([1e4, 0.0]) + np.eye(2) / 9.0)
    combined = random_effects(np.tile([0.1, 0.0], (3, 1)), np.array([first_identified] * 3), WEAK)
    assert combined.covariance[1, 1] == pytest.approx(9.0)
    assert combined.covariance[0, 0] == pytest.approx(1e-4 / 3, rel=1e-3)


def coverage_of_next(count: int, between: float) -> Array:
    """Return the coverage of the next recording by 95 % intervals from `count` recordings, (2,)."""
    rng = np.random.default_rng(3)
    root = np.array([[0.01, 0.0], [0.006, 0.002]])
    within = root @ root.T
    inside = []
    for _ in range(800):
        # The second parameter scatters from day to day, as friction does; the first does not.
        days = np.array([0.0, 1.0]) * rng.normal(0.0, between, (count, 1))
        given = days + rng.multivariate_normal(np.zeros(2), within, count)
        combined = random_effects(given, np.array([with_prior(within)] * count), WEAK)
        coming = np.array([0.0, rng.normal(0.0, between)])
        inside.append(np.abs(coming - combined.mean) < 1.96 * np.sqrt(np.diag(combined.covariance)))
    return np.asarray(np.mean(inside, axis=0))


@pytest.mark.parametrize(("count", "between"), [(3, 0.1), (8, 0.03)])
def test_the_covariance_covers_the_next_recording(count: int, between: float) -> None:
    # A share of 95 % of 800 has an error of 0.8 %. Scatter as small as the errors is detected only in part.
    assert coverage_of_next(count, between).min() > 0.9


def test_without_scatter_the_coverage_of_the_next_recording_is_not_too_high() -> None:
    coverage = coverage_of_next(3, 0.0)
    assert coverage.min() > 0.9
    assert coverage.max() < 0.985


def test_the_birge_ratio_is_the_scatter_relative_to_the_errors() -> None:
    within = np.diag([1e-4, 1e-4])
    deviating = np.array([[0.03, 0.0], [-0.03, 0.0], [0.0, 0.03], [0.0, -0.03]])
    ratio = random_effects(deviating, np.array([with_prior(within)] * 4), WEAK).birge_ratio
    # Four deviations of 3 standard errors each, over 4 × 2 - 2 degrees of freedom.
    assert ratio == pytest.approx((4 * 9 / 6) ** 0.5, rel=1e-3)


def test_estimates_without_information_do_not_change_the_scatter_of_the_others() -> None:
    estimates = np.array([[0.1], [-0.2], [0.15], [0.05]])
    covariances = np.full((4, 1, 1), 0.02**2)
    alone = random_effects(estimates, covariances, np.ones(1))
    # An estimate without information has the mean and the variance of its prior.
    many = np.concatenate([estimates, np.zeros((36, 1))]), np.concatenate([covariances, np.ones((36, 1, 1))])
    together = random_effects(*many, np.ones(1))
    assert alone.scatter[0, 0] > 0
    np.testing.assert_allclose(together.scatter, alone.scatter, rtol=0.02)


def test_the_scatter_covers_the_next_recording_where_errors_differ() -> None:
    rng, size, count = np.random.default_rng(29), 0.1, 10
    within = 0
    for _ in range(500):
        errors = 0.02 * np.exp(rng.normal(0.0, np.log(3), count))
        estimates = size * rng.normal(size=count) + errors * rng.normal(size=count)
        meta = random_effects(estimates[:, np.newaxis], errors[:, np.newaxis, np.newaxis] ** 2, np.ones(1))
        following = size * rng.normal()
        within += abs(following - meta.mean[0]) < 1.96 * meta.covariance[0, 0] ** 0.5
    # Where all estimates counted alike, 0.83 were covered.
    assert within / 500 > 0.88
