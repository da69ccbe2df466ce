"""The variance of a sum of correlated terms: cosine transforms against SciPy, and size against theory."""

import numpy as np
import pytest
from scipy.fft import dct

from emaphm.estimation.uncertainty.long_run_variance import cosine_transforms, long_run_covariance


@pytest.mark.parametrize("samples", [2, 5, 6, 2500, 2501])
def test_cosine_transforms_are_those_of_scipy(samples: int) -> None:
    rows = np.random.default_rng(3).normal(size=(3, samples))
    expected = dct(rows, axis=1, norm="ortho")[:, 1 : samples // 2 + 1]
    np.testing.assert_allclose(cosine_transforms(rows, samples // 2), expected, rtol=0, atol=1e-13)


def test_the_long_run_variance_of_an_autoregression_is_the_closed_form() -> None:
    # A first-order autoregression x_i = a x_{i-1} + e_i has a long-run variance of 1 / (1 - a)² per term.
    samples, a = 4000, 0.8
    rng = np.random.default_rng(6)
    variances = []
    for _ in range(20):
        noise = rng.normal(size=samples)
        row = np.empty(samples)
        row[0] = noise[0] / np.sqrt(1 - a**2)
        for i in range(1, samples):
            row[i] = a * row[i - 1] + noise[i]
        variances.append(long_run_covariance(row[np.newaxis])[0, 0] / samples)
    # 100 transforms of 20 rows: a standard error of sqrt(2 / 2000), 3 %; higher ones are a few percent less.
    assert np.mean(variances) == pytest.approx(1 / (1 - a) ** 2, rel=0.1)
