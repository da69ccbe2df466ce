"""Standard errors against closed forms and against how much estimates really scatter."""

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
# Slow regressors, as the derivatives of a current by a fault are: they do not average a slow residual out.
DERIVATIVES = np.stack([np.sin(20 * TIME), np.cos(33 * TIME), np.ones(SAMPLES)])
WIDE = np.full(3, 1e6)
"""A prior that says nothing."""

DRAWS = 500
SAMPLING = 3 / np.sqrt(2 * DRAWS)
"""Three standard deviations of a standard deviation that is estimated from the draws, relative."""


def covariance(derivatives: Array, residual: Array, prior_deviation: Array) -> Array:
    return sandwich_covariance(derivatives[np.newaxis], residual, prior_deviation).covariance


def errors_of_estimates(residuals: Array) -> Array:
    """Return how far a linear least-squares estimate is moved by each of `residuals`, shape (draws, d)."""
    normal = DERIVATIVES @ DERIVATIVES.T
    return np.asarray(np.linalg.solve(normal, DERIVATIVES @ residuals.T).T)


def what_is_left(residuals: Array) -> Array:
    """Return the residuals after the fit, which is what an estimator sees."""
    return np.asarray(residuals - errors_of_estimates(residuals) @ DERIVATIVES)


def autoregressive(rho: float, draws: int = DRAWS) -> Array:
    """Return stationary first-order autoregressions of unit variance, shape (draws, samples)."""
    rng = np.random.default_rng(0)
    noise = rng.normal(0, np.sqrt(1 - rho**2), (draws, SAMPLES + 500))
    return np.asarray(lfilter([1.0], [1.0, -rho], noise, axis=1)[:, 500:])


def typical_errors(residuals: Array, count: int = 100) -> Array:
    """Return the root mean square of the standard errors that `covariance` gives for the first residuals."""
    left = what_is_left(residuals[:count])
    return np.asarray(np.sqrt(np.mean([np.diag(covariance(DERIVATIVES, one, WIDE)) for one in left], axis=0)))


def test_white_noise_gives_the_textbook_covariance() -> None:
    sigma = 0.3
    white = sigma * np.random.default_rng(1).normal(size=(100, SAMPLES))
    mean = np.mean([covariance(DERIVATIVES, one, WIDE) for one in what_is_left(white)], axis=0)
    exact = sigma**2 * np.linalg.inv(DERIVATIVES @ DERIVATIVES.T)
    # The sandwich takes some 70 transforms: of each matrix some 15 % noise, of the mean of 100 a tenth of
    # that; and the fit has taken some of the lowest from the residual.
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    np.testing.assert_allclose(mean / scale, exact / scale, rtol=0, atol=0.05)


@pytest.mark.parametrize(
    ("rho", "short_by"),
    # The transforms reach up to 74 Hz: the more slowly the residual forgets, the more of its power is below
    # that, and the more they understate it (the spectrum of 0.9 falls to half at 84 Hz).
    [(0.0, 0.05), (0.5, 0.1), (0.9, 0.2)],
)
def test_the_sandwich_agrees_with_how_estimates_scatter(rho: float, short_by: float) -> None:
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
def test_errors_of_a_fit_that_weighs_its_prior_wrongly_are_allowed_for(rho: float, rows: float) -> None:
    # White residuals of the same size would leave about as much to the prior as to the data.
    residuals, size = autoregressive(rho), 25.0
    prior, rng = np.array([0.5, 1.0, 2.0]), np.random.default_rng(1)
    truths = prior * rng.normal(size=(DRAWS, 3))
    normal = DERIVATIVES @ DERIVATIVES.T / size**2 + np.diag(rows / prior**2)
    recorded = truths @ DERIVATIVES + size * residuals
    found = np.linalg.solve(normal, DERIVATIVES @ recorded.T / size**2).T
    stated = [
        sandwich_covariance(DERIVATIVES[np.newaxis], one, prior, prior_rows=rows).covariance
        for one in (recorded - found @ DERIVATIVES)[:100]
    ]
    ratio = np.sqrt(np.mean([np.diag(matrix) for matrix in stated], axis=0)) / np.sqrt(
        np.mean((found - truths) ** 2, axis=0)
    )
    assert np.all(np.abs(ratio - 1) < 0.2), ratio


def test_a_component_without_effect_keeps_its_prior() -> None:
    derivatives = np.concatenate([DERIVATIVES, np.zeros((1, SAMPLES))])
    white = np.random.default_rng(2).normal(0, 0.1, SAMPLES)
    found = covariance(derivatives, white, np.array([1.0, 1.0, 1.0, 0.29]))
    assert found[3, 3] == pytest.approx(0.29**2)
    np.testing.assert_allclose(found[3, :3], 0, atol=1e-15)
    np.testing.assert_allclose(found[:3, :3], covariance(DERIVATIVES, white, np.ones(3)))


def test_two_collinear_components_share_the_prior() -> None:
    derivatives = np.concatenate([DERIVATIVES, DERIVATIVES[:1]])
    white = np.random.default_rng(2).normal(0, 0.1, SAMPLES)
    found = covariance(derivatives, white, np.full(4, 0.29))
    # The data know the sum, the prior the difference: variance 2 × 0.29² of it, half of that each.
    assert found[0, 0] == pytest.approx(0.29**2 / 2, rel=0.01)
    assert found[0, 3] == pytest.approx(-(0.29**2) / 2, rel=0.01)


def test_noise_of_derivatives_does_not_pass_for_information() -> None:
    rng = np.random.default_rng(3)
    white = rng.normal(0, 0.1, SAMPLES)
    # The fourth component has no effect at all, but its differences catch kinks: noise as large as 1.
    exact = np.concatenate([DERIVATIVES, np.zeros((1, SAMPLES))])
    noise = np.zeros((8, 4, SAMPLES))
    noise[:, 3] = rng.normal(size=(8, SAMPLES))
    prior = np.full(4, 0.29)
    fooled = np.sqrt(sandwich_covariance((exact + noise[0])[np.newaxis], white, prior).covariance[3, 3])
    # 0.1 / sqrt(2500): what a component of that effect would be known to.
    assert fooled == pytest.approx(0.1 / np.sqrt(SAMPLES), rel=0.2)
    several = sandwich_covariance(exact + noise, white, prior)
    # Over 28 pairs the products of noise come to some 50 / sqrt(28) in 2500 rows, positive or not.
    assert several.information[3, 3] < 0.05 * SAMPLES / 0.1**2
    assert np.sqrt(several.covariance[3, 3]) > 3 * fooled
    # What a component that nothing is known of might explain, the others cannot claim: they only lose.
    alone = sandwich_covariance(exact[np.newaxis, :3], white, prior[:3]).covariance
    ratios = np.sqrt(np.diag(several.covariance)[:3] / np.diag(alone))
    assert np.all((ratios > 0.9) & (ratios < 3))


@given(
    residual=arrays(np.float64, 60, elements=st.floats(-10, 10)),
    derivatives=arrays(np.float64, (3, 60), elements=st.floats(-10, 10)),
    prior=st.floats(1e-2, 10),
)
def test_positive_definite_whatever_the_residual(residual: Array, derivatives: Array, prior: float) -> None:
    residual[0] += 0.1  # an all-zero residual is another test's
    found = covariance(derivatives, residual, np.full(3, prior))
    np.testing.assert_array_equal(found, found.T)
    assert np.linalg.eigvalsh(found)[0] > 0


def test_a_perfect_fit_leaves_the_prior_of_what_has_no_effect() -> None:
    derivatives = np.concatenate([DERIVATIVES, np.zeros((1, SAMPLES))])
    found = covariance(derivatives, np.zeros(SAMPLES), np.full(4, 0.29))
    np.testing.assert_allclose(found, np.diag([0, 0, 0, 0.29**2]), atol=1e-12)


def test_what_happens_in_two_channels_at_once_counts_once() -> None:
    white = np.random.default_rng(4).normal(0, 0.1, SAMPLES)
    once = covariance(DERIVATIVES, white, WIDE)
    twice = sandwich_covariance(
        np.tile(DERIVATIVES, 2)[np.newaxis], np.tile(white, 2), WIDE, channels=2
    ).covariance
    # But for the least spread, by which alone there seem to be two.
    np.testing.assert_allclose(twice, once, rtol=2 * LEAST_SCORE_VARIANCE)
    # Noise of its own in either channel is worth two recordings.
    apart = np.concatenate([white, np.random.default_rng(5).normal(0, 0.1, SAMPLES)])
    halved = np.diag(
        sandwich_covariance(np.tile(DERIVATIVES, 2)[np.newaxis], apart, WIDE, channels=2).covariance
    ) / np.diag(once)
    np.testing.assert_allclose(halved, 0.5, rtol=0.4)


def test_a_residual_that_is_large_where_the_model_moves_counts_for_more() -> None:
    # Louder by the square of the first regressor: its estimate follows the loud part.
    loudness = DERIVATIVES[0] ** 2
    residuals = loudness * autoregressive(0.0)
    actual = errors_of_estimates(residuals).std(axis=0)
    ratio = typical_errors(residuals) / actual
    np.testing.assert_allclose(ratio, 1.0, rtol=0, atol=0.05 + SAMPLING)
    stationary = np.sqrt(np.mean(loudness**2) * np.diag(np.linalg.inv(DERIVATIVES @ DERIVATIVES.T)))
    assert np.any(np.abs(stationary / actual - 1) > 0.05 + SAMPLING)


@pytest.mark.parametrize("samples", [50, 2500])
def test_intervals_hold_the_truth_as_often_as_they_say_however_few_the_rows(samples: int) -> None:
    draws = 1000
    values = np.random.default_rng(6).normal(size=(draws, samples))
    level = np.ones((1, samples))
    errors = [np.sqrt(covariance(level, value - value.mean(), np.array([1e6]))[0, 0]) for value in values]
    held = np.mean(np.abs(values.mean(axis=1)) < 1.96 * np.array(errors))
    # Three standard deviations of a share of 95 % of so many.
    assert held == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / draws))


@given(scores=arrays(np.float64, (2, 60), elements=st.floats(-10, 10)), factor=st.floats(0.1, 10))
def test_the_long_run_covariance_is_one(scores: Array, factor: float) -> None:
    estimate = long_run_covariance(scores)
    assert np.linalg.eigvalsh(estimate)[0] >= -1e-9 * max(1.0, np.trace(estimate))
    np.testing.assert_allclose(
        long_run_covariance(factor * scores), factor**2 * estimate, rtol=1e-9, atol=1e-9
    )
    # A constant is what the sum is about, not its scatter.
    np.testing.assert_allclose(long_run_covariance(scores + factor), estimate, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("apart", [1e-3, 1e-6, 1e-9, 0.0])
def test_what_acts_alike_is_known_no_better_than_before_whatever_the_rounding(apart: float) -> None:
    # Two coordinates with some million times the information of the prior, on their sum alone.
    jacobian = 3e3 * np.array([[1.0, 0.0], [1.0, apart]])
    information = jacobian @ jacobian.T
    found = ScoreStatistics(information, 2 * information).covariance(np.full(2, 3.4))
    exact = np.linalg.inv(information / 2 + np.eye(2) / 3.4**2)
    assert np.linalg.eigvalsh(found).min() > 0
    difference = np.array([1.0, -1.0]) / 2**0.5
    assert difference @ found @ difference == pytest.approx(difference @ exact @ difference, rel=1e-3)


def test_a_fit_by_derivatives_that_are_not_the_recordings_errs_as_an_instrument_does() -> None:
    # The recording answers half as much by the second parameter, and later by the third.
    answers = np.stack([DERIVATIVES[0], 0.5 * DERIVATIVES[1], np.roll(DERIVATIVES[2] * np.sin(9 * TIME), 20)])
    draws = np.random.default_rng(6).normal(0, 0.1, (DRAWS, SAMPLES))
    errors = np.linalg.solve(DERIVATIVES @ answers.T, DERIVATIVES @ draws.T)
    residual = draws[0]
    found = sandwich_covariance(DERIVATIVES[np.newaxis], residual, WIDE, response=answers).covariance
    np.testing.assert_allclose(np.sqrt(np.diag(found)), errors.std(axis=1), rtol=0.35)
    plain = sandwich_covariance(DERIVATIVES[np.newaxis], residual, WIDE).covariance
    alike = sandwich_covariance(DERIVATIVES[np.newaxis], residual, WIDE, response=DERIVATIVES).covariance
    np.testing.assert_allclose(alike, plain, rtol=1e-6)
    assert found[1, 1] > 3 * plain[1, 1]
