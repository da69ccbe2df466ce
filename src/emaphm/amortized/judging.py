"""Calibration of an estimator's uncertainty, and its assessment on held-out draws.

*Temperature*: a factor on the standard deviations of each coordinate, so that 95 % of the true values of one
held-out set lie within the 95 % intervals. *Coverage* and *ranks* are then counted on another held-out set:
simulation-based calibration (Talts et al. 2018), in which the rank of the true value among samples of the
posterior is uniform.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.amortized.networks.mixture import Mixture
from emaphm.arrays import Array
from emaphm.diagnosis.verdict import Z95
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.quantiles import chi_squared_quantile

RANK_SAMPLES, RANK_BINS = 255, 16
"""Samples of each posterior among which the true value is ranked, and bins of the ranks: 16 ranks in each."""

MOST_ERROR = 10.0
"""Median error [%] beyond which an estimator is poor: with 16,384 simulations it is 2 %."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """Errors and calibration on held-out `draws`, for each coordinate (d,) in the order of the space.

    `coverage` is the share of true values within the 95 % intervals. `ranks` (d, bins) are the counts of the
    ranks of the true values, and `rank_statistic` (d,) is their χ² against uniform counts, below `rank_limit`
    in 99 % of the cases. `median` and `p95` are the median and the 95th percentile of the error of the means
    [%], which is the root of the sum of squares over the faults.
    """

    draws: int
    median: float
    p95: float
    coverage: Array
    ranks: Array

    @property
    def rank_statistic(self) -> Array:
        """χ² of the ranks of each coordinate, (d,)."""
        expected = self.draws / self.ranks.shape[1]
        return np.asarray(np.sum((self.ranks - expected) ** 2, axis=1) / expected)

    @property
    def rank_limit(self) -> float:
        """The 99 % quantile of χ² for uniform ranks."""
        return chi_squared_quantile(self.ranks.shape[1] - 1, 0.99)

    @property
    def poor(self) -> str | None:
        """The clause that the estimator is of little use, with the reason; None if it is of use."""
        if self.median <= MOST_ERROR:
            return None
        return (
            f"poor: its answers err by {self.median:.3g} % (median), so that most recordings are searched; "
            "give more --simulations"
        )


def temperature_of(mixtures: list[Mixture], truths: Array) -> Array:
    """Return the factors (d,) on the standard deviations with which 95 % of `truths` (n, d) are covered."""
    means = np.array([mixture.mean for mixture in mixtures])
    deviations = np.array([np.sqrt(np.diag(mixture.covariance)) for mixture in mixtures])
    return np.asarray(np.quantile(np.abs(truths - means) / deviations, 0.95, axis=0) / Z95)


def judged(
    mixtures: list[Mixture], truths: Array, space: ParameterSpace, rng: np.random.Generator
) -> Judgement:
    """Return the errors, coverage and ranks of the answers for draws with the true values `truths` (n, d)."""
    n, d = truths.shape
    within, ranks, errors = np.zeros(d), np.zeros((d, RANK_BINS), int), np.empty(n)
    for i, (mixture, truth) in enumerate(zip(mixtures, truths, strict=True)):
        mean, deviation = mixture.mean, np.sqrt(np.diag(mixture.covariance))
        within += np.abs(truth - mean) <= Z95 * deviation
        samples = mixture.inside(space, RANK_SAMPLES, rng)
        rank = np.sum(samples < truth, axis=0)
        ranks[np.arange(d), rank * RANK_BINS // (RANK_SAMPLES + 1)] += 1
        errors[i] = np.sqrt(np.sum((space.project(mean) - truth)[: len(space.columns)] ** 2))
    return Judgement(
        n, 100 * float(np.median(errors)), 100 * float(np.quantile(errors, 0.95)), within / n, ranks
    )
