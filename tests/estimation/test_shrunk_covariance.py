"""The shrunk covariance of scores against that of many draws, of white and of correlated residuals."""

import numpy as np
from scipy.signal import lfilter

from emaphm.arrays import Array
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance
from emaphm.estimation.uncertainty.shrunk_covariance import shrunk_long_run_covariance

SAMPLES, DRAWS = 600, 60
TIME = np.arange(SAMPLES) / SAMPLES
# Some act all the time, some for a twentieth of it, as backlash does where motion reverses.
DERIVATIVES = np.stack(
    [
        *(np.sin(2 * np.pi * n * TIME + n) for n in range(1, 6)),
        *(np.exp(-(((TIME - middle) / 0.02) ** 2)) for middle in (0.2, 0.4, 0.6, 0.8)),
    ]
)


def left_by_the_fit(residuals: Array) -> Array:
    """Return `residuals` (draws, rows) less their fit by the derivatives."""
    fitted = np.linalg.lstsq(DERIVATIVES.T, residuals.T, rcond=None)[0]
    return np.asarray(residuals - fitted.T @ DERIVATIVES)


def seeming_ratios(residuals: Array, covariance: Array, *, shrunk: bool) -> Array:
    """Return the smallest and the mean eigenvalue of estimates relative to `covariance`, (draws, 2)."""
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    estimates = (
        shrunk_long_run_covariance(DERIVATIVES, one) if shrunk else long_run_covariance(DERIVATIVES * one)
        for one in left_by_the_fit(residuals)
    )
    values = np.array([np.linalg.eigvalsh(root @ one @ root.T) for one in estimates])
    return np.stack([values[:, 0], values.mean(axis=1)], axis=1)


def test_of_white_residuals_no_combination_seems_to_be_known_better_than_it_is() -> None:
    white = np.random.default_rng(0).normal(0, 0.3, (DRAWS, SAMPLES))
    exact = 0.3**2 * DERIVATIVES @ DERIVATIVES.T
    found = np.median(seeming_ratios(white, exact, shrunk=False), axis=0)
    shrunk = np.median(seeming_ratios(white, exact, shrunk=True), axis=0)
    assert found[0] < 0.1  # a standard error of which would be a third
    assert shrunk[0] > 0.5
    assert abs(shrunk[1] - 1) < 0.1


def test_of_correlated_residuals_the_shrunk_covariance_is_no_smaller_than_the_other() -> None:
    noise = np.random.default_rng(1).normal(size=(DRAWS, SAMPLES + 200))
    residuals = lfilter([1.0], [1.0, -0.8], noise, axis=1)[:, 200:]
    scores = residuals @ DERIVATIVES.T
    exact = np.cov(scores, rowvar=False)
    found = np.median(seeming_ratios(residuals, exact, shrunk=False), axis=0)
    shrunk = np.median(seeming_ratios(residuals, exact, shrunk=True), axis=0)
    assert np.all(shrunk >= found)


def test_its_unit_is_that_of_the_scores() -> None:
    residual = left_by_the_fit(np.random.default_rng(2).normal(size=(1, SAMPLES)))[0]
    units = np.array([1e-3, 1.0, 1e4, 1.0, 1.0, 1e2, 1.0, 1e-2, 1.0])
    found = shrunk_long_run_covariance(DERIVATIVES, residual)
    scaled = shrunk_long_run_covariance(units[:, np.newaxis] * DERIVATIVES, 2 * residual)
    size = np.sqrt(np.diag(found))
    there = scaled / (4 * np.outer(units * size, units * size))
    np.testing.assert_allclose(there, found / np.outer(size, size), rtol=0, atol=1e-9)


def test_without_effect_or_residual_there_is_no_covariance() -> None:
    residual = np.random.default_rng(3).normal(size=SAMPLES)
    assert not shrunk_long_run_covariance(np.zeros((2, SAMPLES)), residual).any()
    assert np.all(np.isfinite(shrunk_long_run_covariance(DERIVATIVES, np.zeros(SAMPLES))))
