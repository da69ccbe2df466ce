"""Quantiles of the normal and of Student's t distribution, compared with SciPy's; of samples, by counting."""

import numpy as np
import pytest
from scipy.special import ndtri, stdtr, stdtrit

from emaphm.quantiles import (
    normal_quantile,
    sample_quantile,
    student_t_distribution,
    student_t_quantile,
)


def test_normal_quantiles_agree_with_scipy() -> None:
    probabilities = np.linspace(1e-6, 1 - 1e-6, 1001).reshape(7, 143)
    np.testing.assert_allclose(normal_quantile(probabilities), ndtri(probabilities), rtol=1e-12, atol=1e-15)
    assert float(normal_quantile(0.975)) == pytest.approx(1.959963984540054, rel=1e-15)


@pytest.mark.parametrize("freedom", [1, 2, 3, 4, 5, 10, 31, 118, 1001, 11_697])
@pytest.mark.parametrize("probability", [0.5, 0.6, 0.9, 0.975, 0.9999])
def test_student_t_quantiles_agree_with_scipy(freedom: int, probability: float) -> None:
    # SciPy's own inverse is accurate to some 1e-12.
    expected = stdtrit(freedom, probability)
    assert student_t_quantile(freedom, probability) == pytest.approx(expected, rel=1e-11, abs=1e-14)


@pytest.mark.parametrize("freedom", [1, 2, 7, 40])
def test_the_student_t_distribution_agrees_with_scipy(freedom: int) -> None:
    for t in (-30.0, -1.0, 0.0, 0.3, 5.0):
        assert student_t_distribution(freedom, t) == pytest.approx(stdtr(freedom, t), abs=1e-14)


@pytest.mark.parametrize("size", [1, 2, 7, 20, 100])
@pytest.mark.parametrize("without_failure", [0.0, 0.3, 1.0])
def test_a_quantile_is_the_least_value_not_exceeded_by_a_share_of_the_sample(
    size: int, without_failure: float
) -> None:
    rng = np.random.default_rng(size)
    sample = np.where(rng.random(size) < without_failure, np.inf, rng.exponential(100.0, size))
    for probability in (0.05, 0.5, 0.95):
        reached = [x for x in sample if np.count_nonzero(sample <= x) >= probability * size]
        assert sample_quantile(sample, probability) == min(reached)
