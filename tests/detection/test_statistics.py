"""T² and Q against closed forms and scikit-learn; thresholds and rates against exact distributions."""

import numpy as np
import pytest
from scipy import stats

from emaphm.detection.statistics import HealthyScatter
from emaphm.detection.thresholds import (
    effective_number,
    highest_rate,
    joint_thresholds,
    prediction_bound,
    runs_to_show,
)

COVARIANCE = np.array([[4.0, 1.8, 0.0], [1.8, 1.0, 0.0], [0.0, 0.0, 0.01]])


def gaussian(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).multivariate_normal(np.zeros(3), COVARIANCE, count)


def test_over_all_directions_it_is_the_mahalanobis_distance() -> None:
    from sklearn.covariance import LedoitWolf

    healthy, later = gaussian(60, 1), gaussian(20, 2)
    scatter = HealthyScatter.learn(healthy, variance_share=0.9)
    scale = np.sqrt(np.mean(healthy**2, axis=0))
    oracle = LedoitWolf(assume_centered=True).fit(healthy / scale)
    whole = np.sum(scatter.whitened(later) ** 2, axis=1)
    np.testing.assert_allclose(whole, oracle.mahalanobis(later / scale), rtol=1e-9)
    # T² lacks the contribution of the direction of Q, here one: Q over its variance.
    assert scatter.rank == 2
    np.testing.assert_allclose(whole - scatter.t2(later), scatter.q(later) / scatter.variances[2], rtol=1e-9)


def test_t2_of_a_gaussian_is_chi_squared() -> None:
    # 20,000 cycles determine the covariance to 1 %: T² has as many degrees of freedom as directions.
    scatter = HealthyScatter.learn(gaussian(20_000, 3), variance_share=1.0)
    assert scatter.rank == 2
    assert stats.kstest(scatter.t2(gaussian(2000, 4)), stats.chi2(2).cdf).pvalue > 0.01
    few = HealthyScatter.learn(gaussian(20_000, 3), variance_share=0.6)
    assert few.rank == 1
    assert stats.kstest(few.t2(gaussian(2000, 4)), stats.chi2(1).cdf).pvalue > 0.01


def test_q_is_the_squared_residual_from_the_principal_components() -> None:
    from sklearn.decomposition import PCA

    healthy, later = gaussian(20_000, 5), gaussian(50, 6)
    scatter = HealthyScatter.learn(healthy, variance_share=0.6)
    oracle = PCA(n_components=1).fit(healthy / scatter.scale)
    left = later / scatter.scale - oracle.inverse_transform(oracle.transform(later / scatter.scale))
    # 20,000 cycles determine a direction to 1 / √20,000; the mean Q is 1.
    np.testing.assert_allclose(scatter.q(later), np.sum(left**2, axis=1), atol=0.02)


def test_contributions_add_up_and_are_where_the_deviation_is() -> None:
    scatter = HealthyScatter.learn(gaussian(500, 7), variance_share=0.9)
    deviation = np.array([[0.0, 0.0, 1.0]])  # ten standard deviations, of one feature
    for contributions, whole in (
        (scatter.t2_contributions(deviation), scatter.t2(deviation)),
        (scatter.q_contributions(deviation), scatter.q(deviation)),
    ):
        assert np.all(contributions >= 0)
        assert contributions.sum() == pytest.approx(float(whole[0]))
    both = scatter.t2_contributions(deviation) + scatter.q_contributions(deviation)
    assert both[0, 2] > 0.95 * both.sum()


def test_a_change_of_a_feature_without_variation_is_detected() -> None:
    healthy = gaussian(50, 8)
    healthy[:, 2] = 0.0
    scatter = HealthyScatter.learn(healthy, variance_share=0.9)
    changed = np.array([[0.0, 0.0, 0.5]])
    assert float(scatter.t2(changed)[0] + scatter.q(changed)[0]) > 1e6


def test_no_alarm_in_fifteen_shows_eighteen_percent() -> None:
    assert highest_rate(0, 15, 0.95) == pytest.approx(1 - 0.05 ** (1 / 15))
    assert round(100 * highest_rate(0, 15, 0.95)) == 18
    assert highest_rate(15, 15, 0.95) == 1.0
    # Clopper and Pearson: at the bound, so few alarms or fewer have the probability 5 %.
    assert stats.binom.cdf(3, 40, highest_rate(3, 40, 0.95)) == pytest.approx(0.05)


def test_runs_that_show_a_rate_do_so_and_one_fewer_does_not() -> None:
    needed = runs_to_show(0.01, 0.95)
    assert needed == 299
    assert highest_rate(0, needed, 0.95) <= 0.01 < highest_rate(0, needed - 1, 0.95)


def test_a_further_normal_value_exceeds_the_prediction_bound_at_its_rate() -> None:
    rng = np.random.default_rng(9)
    draws = rng.normal(size=(4000, 9))
    exceeded = sum(one[8] > prediction_bound(one[:8], 8, 0.05) for one in draws)
    # Exact for normal values: 200 of 4,000 expected, standard deviation 13.8.
    assert abs(exceeded - 200) < 3 * 13.8


def test_the_effective_number_depends_on_the_correlation_within_a_run() -> None:
    runs = np.repeat(np.arange(4000), 5)
    rng = np.random.default_rng(10)
    alike = np.repeat(rng.normal(size=4000), 5)
    assert effective_number(alike, runs) == pytest.approx(4000)
    assert effective_number(alike[::5], np.arange(4000)) == 4000
    # The standard error of the correlation is √(2 / (5·4·4000)) = 0.005; three of them change it by 6 %.
    assert effective_number(rng.normal(size=20_000), runs) > 0.94 * 20_000
    half = alike + rng.normal(size=20_000)  # correlation 1/2: n / (1 + 4/2)
    assert effective_number(half, runs) == pytest.approx(20_000 / 3, rel=0.05)


def test_two_statistics_share_one_rate() -> None:
    rng = np.random.default_rng(11)
    runs = np.arange(2000)
    scores = np.exp(rng.normal(size=(2000, 2)))
    thresholds, _ = joint_thresholds(scores, runs, 0.05)
    later = np.exp(rng.normal(size=(20_000, 2)))
    # The largest of two normal values is a little skewed: the rate is that of the bound within a percent.
    assert np.mean(np.any(later > thresholds, axis=1)) == pytest.approx(0.05, abs=0.01)
