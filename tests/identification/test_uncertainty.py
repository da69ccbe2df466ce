"""Standard errors against closed forms and against how much estimates really scatter."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from emaphm.identification.uncertainty import _correlated, bandwidth, knowledge

Array = NDArray[np.float64]

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
    return knowledge(derivatives, residual, prior_deviation).covariance


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
    # The sandwich adds a few sample autocovariances: of each matrix some 10 % noise, of the mean of 100
    # a tenth of that; and it drops what the tapered lags take from the variance of slow regressors.
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    np.testing.assert_allclose(mean / scale, exact / scale, rtol=0, atol=0.05)


@pytest.mark.parametrize(
    ("rho", "short_by"),
    # The sample autocovariance is cut at a bandwidth and tapered: the more slowly the residual forgets,
    # the more is missed. Andrews (1991, table I) has the like for the same kernel.
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
    # sqrt((1 + 0.9) / (1 - 0.9)) = 4.36 for regressors that are slow beside the residual.
    assert np.all(actual / naive > 3.5)
    assert np.all(typical_errors(residuals) / naive > 3.0)


def test_a_component_without_effect_keeps_its_prior() -> None:
    derivatives = np.concatenate([DERIVATIVES, np.zeros((1, SAMPLES))])
    white = np.random.default_rng(2).normal(0, 0.1, SAMPLES)
    found = covariance(derivatives, white, np.array([1.0, 1.0, 1.0, 0.29]))
    assert found[3, 3] == pytest.approx(0.29**2)
    np.testing.assert_allclose(found[3, :3], 0, atol=1e-15)
    np.testing.assert_allclose(found[:3, :3], covariance(DERIVATIVES, white, np.ones(3)))


def test_two_components_that_cannot_be_told_apart_share_the_prior() -> None:
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
    fooled = np.sqrt(knowledge(exact + noise[0], white, prior).covariance[3, 3])
    # 0.1 / sqrt(2500): what a component of that effect would be known to.
    assert fooled == pytest.approx(0.1 / np.sqrt(SAMPLES), rel=0.2)
    several = knowledge(exact + noise, white, prior)
    # Over 28 pairs the products of noise come to some 50 / sqrt(28) in 2500 rows, positive or not.
    assert several.information[3, 3] < 0.05 * SAMPLES / 0.1**2
    assert np.sqrt(several.covariance[3, 3]) > 3 * fooled
    # What a component that nothing is known of might explain, the others cannot claim: they only lose.
    alone = knowledge(exact[:3], white, prior[:3]).covariance
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


def test_a_perfect_fit_leaves_only_what_the_data_do_not_tell() -> None:
    derivatives = np.concatenate([DERIVATIVES, np.zeros((1, SAMPLES))])
    found = covariance(derivatives, np.zeros(SAMPLES), np.full(4, 0.29))
    np.testing.assert_allclose(found, np.diag([0, 0, 0, 0.29**2]), atol=1e-12)


@given(residual=arrays(np.float64, 50, elements=st.floats(-10, 10)), seed=st.integers(0, 9))
def test_the_convolution_is_the_product_with_the_tapered_autocovariance(residual: Array, seed: int) -> None:
    derivatives = np.random.default_rng(seed).normal(size=(2, 50))
    lags = bandwidth(residual)
    centred = residual - residual.mean()
    column = np.zeros(50)
    for lag in range(lags + 1):
        column[lag] = (1 - lag / (lags + 1)) * np.sum(centred[lag:] * centred[: 50 - lag]) / 50
    column[0] += residual.mean() ** 2
    np.testing.assert_allclose(
        _correlated(derivatives, residual), derivatives @ toeplitz(column), rtol=0, atol=1e-10
    )


@pytest.mark.parametrize("rho", [0.3, 0.7, 0.9])
def test_the_bandwidth_is_that_of_andrews(rho: float) -> None:
    found = np.median([bandwidth(one) for one in autoregressive(rho, 50)])
    # 1.1447 (4 rho² n / (1 - rho²)²)^(1/3); rho is estimated to sqrt((1 - rho²) / n), a few per cent of it.
    exact = 1.1447 * (4 * rho**2 * SAMPLES / (1 - rho**2) ** 2) ** (1 / 3)
    assert found == pytest.approx(exact, rel=0.05, abs=1)


@pytest.mark.parametrize(
    "residual",
    [np.zeros(50), np.full(50, 3.0), np.arange(50.0), (-1.0) ** np.arange(50)],
    ids=["zero", "constant", "trend", "alternating"],
)
def test_the_bandwidth_stays_within_reason(residual: Array) -> None:
    assert 1 <= bandwidth(residual) <= 12
