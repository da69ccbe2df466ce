"""Standard errors against closed forms and against the actual scatter of estimates."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.signal import lfilter

from emaphm.arrays import Array
from emaphm.estimation.uncertainty.covariance import (
    LEAST_SCORE_VARIANCE,
    ScoreStatistics,
    sandwich_covariance,
)
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance

SAMPLES = 2500
TIME = np.arange(SAMPLES) / 5000
# Slow regressors, like the derivatives of a current by a fault: a slow residual does not average out.
DERIVATIVES = np.stack([np.sin(20 * TIME), np.cos(33 * TIME), np.ones(SAMPLES)])
WIDE = np.full(3, 1e6)
"""Standard deviations of an uninformative prior."""

DRAWS = 500
SAMPLING = 3 / np.sqrt(2 * DRAWS)
"""Three standard deviations of a standard deviation that is estimated from the draws, relative."""


def covariance(derivatives: Array, residual: Array, prior_deviation: Array) -> Array:
    return sandwich_covariance(derivatives[np.newaxis], residual, prior_deviation).covariance


def errors_of_estimates(residuals: Array) -> Array:
    """Return the errors of a linear least-squares estimate by each of `residuals`, shape (draws, d)."""
    normal = DERIVATIVES @ DERIVATIVES.T
    return np.asarray(np.linalg.solve(normal, DERIVATIVES @ residuals.T).T)


def residuals_after_fit(residuals: Array) -> Array:
    """Return the residuals after the fit, which are the residuals that an estimator has."""
    return np.asarray(residuals - errors_of_estimates(residuals) @ DERIVATIVES)


def autoregressive(rho: float, draws: int = DRAWS) -> Array:
    """Return stationary first-order autoregressions of unit variance, shape (draws, samples)."""
    rng = np.random.default_rng(0)
    noise = rng.normal(0, np.sqrt(1 - rho**2), (draws, SAMPLES + 500))
    return np.asarray(lfilter([1.0], [1.0, -rho], noise, axis=1)[:, 500:])


def typical_errors(residuals: Array, count: int = 100) -> Array:
    """Return the root mean square of the standard errors that `covariance` gives for the first residuals."""
    after_fit = residuals_after_fit(residuals[:count])
    return np.asarray(
        np.sqrt(np.mean([np.diag(covariance(DERIVATIVES, residual, WIDE)) for residual in after_fit], axis=0))
    )


def test_white_noise_gives_the_textbook_covariance() -> None:
    sigma = 0.3
    white = sigma * np.random.default_rng(1).normal(size=(100, SAMPLES))
    mean = np.mean(
        [covariance(DERIVATIVES, residual, WIDE) for residual in residuals_after_fit(white)], axis=0
    )
    exact = sigma**2 * np.linalg.inv(DERIVATIVES @ DERIVATIVES.T)
    # The sandwich takes some 70 transforms: each matrix has some 15 % noise, the mean of 100 a tenth of
    # that; and the fit has removed some of the lowest transforms from the residual.
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    np.testing.assert_allclose(mean / scale, exact / scale, rtol=0, atol=0.05)


@pytest.mark.parametrize(
    ("rho", "short_by"),
    # The transforms reach up to 74 Hz: the longer the residual is correlated, the more of its power is below
    # 74 Hz, and the more they underestimate it (the spectrum for 0.9 falls to half at 84 Hz).
    [(0.0, 0.05), (0.5, 0.1), (0.9, 0.2)],
)
def test_the_sandwich_agrees_with_the_scatter_of_estimates(rho: float, short_by: float) -> None:
    residuals = autoregressive(rho)
    actual = errors_of_estimates(residuals).std(axis=0)
    ratio = typical_errors(residuals) / actual
    assert np.all(ratio > 1 - short_by - SAMPLING)
    assert np.all(ratio < 1 + SAMPLING)


def test_the_white_formula_would_be_too_small_for_correlated_residuals() -> None:
    residuals = autoregressive(0.9)
    actual = errors_of_estimates(residuals).std(axis=0)
    naive = np.sqrt(np.diag(np.linalg.inv(DERIVATIVES @ DERIVATIVES.T)))
    # sqrt((1 + 0.9) / (1 - 0.9)) = 4.36 for regressors that are slow compared with the residual.
    assert np.all(actual / naive > 3.5)
    assert np.all(typical_errors(residuals) / naive > 3.0)


@pytest.mark.parametrize(("rho", "rows"), [(0.0, 1.0), (-0.9, 1.0), (0.0, 10.0), (0.5, 3.0)])
def test_the_error_of_a_wrong_weight_of_the_prior_is_in_the_covariance(rho: float, rows: float) -> None:
    # With white residuals of the same size, prior and data would have about the same weight.
    residuals, size = autoregressive(rho), 25.0
    prior, rng = np.array([0.5, 1.0, 2.0]), np.random.default_rng(1)
    truths = prior * rng.normal(size=(DRAWS, 3))
    normal = DERIVATIVES @ DERIVATIVES.T / size**2 + np.diag(rows / prior**2)
    recorded = truths @ DERIVATIVES + size * residuals
    estimate = np.linalg.solve(normal, DERIVATIVES @ recorded.T / size**2).T
    stated = [
        sandwich_covariance(DERIVATIVES[np.newaxis], residual, prior, prior_rows=rows).covariance
        for residual in (recorded - estimate @ DERIVATIVES)[:100]
    ]
    ratio = np.sqrt(np.mean([np.diag(matrix) for matrix in stated], axis=0)) / np.sqrt(
        np.mean((estimate - truths) ** 2, axis=0)
    )
    assert np.all(np.abs(ratio - 1) < 0.2), ratio


def test_a_component_without_effect_keeps_its_prior() -> None:
    derivatives = np.concatenate([DERIVATIVES, np.zeros((1, SAMPLES))])
    white = np.random.default_rng(2).normal(0, 0.1, SAMPLES)
    result = covariance(derivatives, white, np.array([1.0, 1.0, 1.0, 0.29]))
    assert result[3, 3] == pytest.approx(0.29**2)
    np.testing.assert_allclose(result[3, :3], 0, atol=1e-15)
    np.testing.assert_allclose(result[:3, :3], covariance(DERIVATIVES, white, np.ones(3)))


def test_two_collinear_components_share_the_prior() -> None:
    derivatives = np.concatenate([DERIVATIVES, DERIVATIVES[:1]])
    white = np.random.default_rng(2).normal(0, 0.1, SAMPLES)
    result = covariance(derivatives, white, np.full(4, 0.29))
    # The data identify the sum, the prior the difference: its variance is 2 × 0.29², half of that for each.
    assert result[0, 0] == pytest.approx(0.29**2 / 2, rel=0.01)
    assert result[0, 3] == pytest.approx(-(0.29**2) / 2, rel=0.01)


def test_noise_of_derivatives_is_not_counted_as_information() -> None:
    rng = np.random.default_rng(3)
    white = rng.normal(0, 0.1, SAMPLES)
    # The fourth component has no effect at all, but its differences catch kinks: noise as large as 1.
    exact = np.concatenate([DERIVATIVES, np.zeros((1, SAMPLES))])
    noise = np.zeros((8, 4, SAMPLES))
    noise[:, 3] = rng.normal(size=(8, SAMPLES))
    prior = np.full(4, 0.29)
    fooled = np.sqrt(sandwich_covariance((exact + noise[0])[np.newaxis], white, prior).covariance[3, 3])
    # 0.1 / sqrt(2500): the standard error of a component with a true effect of that size.
    assert fooled == pytest.approx(0.1 / np.sqrt(SAMPLES), rel=0.2)
    several = sandwich_covariance(exact + noise, white, prior)
    # Over 28 pairs the products of noise come to some 50 / sqrt(28) in 2500 rows, positive or not.
    assert several.information[3, 3] < 0.05 * SAMPLES / 0.1**2
    assert np.sqrt(several.covariance[3, 3]) > 3 * fooled
    # An unidentified component may explain a part of the effect of the others: their errors only grow.
    alone = sandwich_covariance(exact[np.newaxis, :3], white, prior[:3]).covariance
    ratios = np.sqrt(np.diag(several.covariance)[:3] / np.diag(alone))
    assert np.all((ratios > 0.9) & (ratios < 3))


@given(
    residual=arrays(np.float64, 60, elements=st.floats(-10, 10)),
    derivatives=arrays(np.float64, (3, 60), elements=st.floats(-10, 10)),
    prior=st.floats(1e-2, 10),
)
def test_the_covariance_is_positive_definite_for_any_residual(
    residual: Array, derivatives: Array, prior: float
) -> None:
    residual[0] += 0.1  # another test has an all-zero residual
    result = covariance(derivatives, residual, np.full(3, prior))
    np.testing.assert_array_equal(result, result.T)
    assert np.linalg.eigvalsh(result)[0] > 0


def test_after_a_perfect_fit_only_a_component_without_effect_has_variance() -> None:
    derivatives = np.concatenate([DERIVATIVES, np.zeros((1, SAMPLES))])
    result = covariance(derivatives, np.zeros(SAMPLES), np.full(4, 0.29))
    np.testing.assert_allclose(result, np.diag([0, 0, 0, 0.29**2]), atol=1e-12)


def test_a_residual_common_to_two_channels_counts_once() -> None:
    white = np.random.default_rng(4).normal(0, 0.1, SAMPLES)
    once = covariance(DERIVATIVES, white, WIDE)
    twice = sandwich_covariance(
        np.tile(DERIVATIVES, 2)[np.newaxis], np.tile(white, 2), WIDE, channels=2
    ).covariance
    # Equal except for the lower limit of the score variance, which counts twice.
    np.testing.assert_allclose(twice, once, rtol=2 * LEAST_SCORE_VARIANCE)
    # Independent noise in each channel has the information of two recordings.
    independent = np.concatenate([white, np.random.default_rng(5).normal(0, 0.1, SAMPLES)])
    halved = np.diag(
        sandwich_covariance(np.tile(DERIVATIVES, 2)[np.newaxis], independent, WIDE, channels=2).covariance
    ) / np.diag(once)
    np.testing.assert_allclose(halved, 0.5, rtol=0.4)


def test_a_residual_correlated_with_the_regressors_in_size_increases_the_error() -> None:
    # The residual is scaled by the square of the first regressor: this estimate depends on the loud rows.
    loudness = DERIVATIVES[0] ** 2
    residuals = loudness * autoregressive(0.0)
    actual = errors_of_estimates(residuals).std(axis=0)
    ratio = typical_errors(residuals) / actual
    np.testing.assert_allclose(ratio, 1.0, rtol=0, atol=0.05 + SAMPLING)
    stationary = np.sqrt(np.mean(loudness**2) * np.diag(np.linalg.inv(DERIVATIVES @ DERIVATIVES.T)))
    assert np.any(np.abs(stationary / actual - 1) > 0.05 + SAMPLING)


@pytest.mark.parametrize("samples", [50, 2500])
def test_intervals_have_their_nominal_coverage_for_any_number_of_rows(samples: int) -> None:
    draws = 1000
    values = np.random.default_rng(6).normal(size=(draws, samples))
    level = np.ones((1, samples))
    errors = [np.sqrt(covariance(level, value - value.mean(), np.array([1e6]))[0, 0]) for value in values]
    held = np.mean(np.abs(values.mean(axis=1)) < 1.96 * np.array(errors))
    # Three standard deviations of a share of 95 % of the draws.
    assert held == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / draws))


@given(scores=arrays(np.float64, (2, 60), elements=st.floats(-10, 10)), factor=st.floats(0.1, 10))
def test_the_long_run_covariance_is_semidefinite_and_ignores_constants(scores: Array, factor: float) -> None:
    estimate = long_run_covariance(scores)
    assert np.linalg.eigvalsh(estimate)[0] >= -1e-9 * max(1.0, np.trace(estimate))
    np.testing.assert_allclose(
        long_run_covariance(factor * scores), factor**2 * estimate, rtol=1e-9, atol=1e-9
    )
    # A constant changes the mean of the sum and not its scatter.
    np.testing.assert_allclose(long_run_covariance(scores + factor), estimate, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("apart", [1e-3, 1e-6, 1e-9, 0.0])
def test_rounding_adds_no_information_on_a_difference_that_has_no_effect(apart: float) -> None:
    # Two coordinates with some million times the information of the prior, on their sum alone.
    jacobian = 3e3 * np.array([[1.0, 0.0], [1.0, apart]])
    information = jacobian @ jacobian.T
    result = ScoreStatistics(information, 2 * information).covariance(np.full(2, 3.4))
    exact = np.linalg.inv(information / 2 + np.eye(2) / 3.4**2)
    assert np.linalg.eigvalsh(result).min() > 0
    difference = np.array([1.0, -1.0]) / 2**0.5
    assert difference @ result @ difference == pytest.approx(difference @ exact @ difference, rel=1e-3)


def test_a_fit_with_wrong_derivatives_has_the_error_of_instrumental_variables() -> None:
    # The recording responds half as much to the second parameter, and later to the third.
    answers = np.stack([DERIVATIVES[0], 0.5 * DERIVATIVES[1], np.roll(DERIVATIVES[2] * np.sin(9 * TIME), 20)])
    draws = np.random.default_rng(6).normal(0, 0.1, (DRAWS, SAMPLES))
    errors = np.linalg.solve(DERIVATIVES @ answers.T, DERIVATIVES @ draws.T)
    residual = draws[0]
    result = sandwich_covariance(DERIVATIVES[np.newaxis], residual, WIDE, response=answers).covariance
    np.testing.assert_allclose(np.sqrt(np.diag(result)), errors.std(axis=1), rtol=0.35)
    plain = sandwich_covariance(DERIVATIVES[np.newaxis], residual, WIDE).covariance
    alike = sandwich_covariance(DERIVATIVES[np.newaxis], residual, WIDE, response=DERIVATIVES).covariance
    np.testing.assert_allclose(alike, plain, rtol=1e-6)
    assert result[1, 1] > 3 * plain[1, 1]
