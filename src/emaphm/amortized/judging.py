"""Whether an estimator's answers are as sure as they say, judged on draws that it has not learned from.

*Temperature*: a factor for each coordinate's standard deviations, from one held-out set, by which 95 % of the
truths lie within the 95 % intervals. *Coverage* and *ranks* are then counted on another: simulation-based
calibration (Talts et al. 2018), in which the rank of the truth among samples of the posterior is even.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.amortized.networks.mixture import Mixture
from emaphm.arrays import Array
from emaphm.diagnosis.verdict import Z95
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.quantiles import chi_squared_quantile

RANK_SAMPLES, RANK_BINS = 255, 16
"""Samples of each posterior that the truth is ranked among, and bins that the ranks are counted in: 16 ranks
each."""

MOST_ERROR = 10.0
"""Median error [%] beyond which an estimator is poor: 16,384 simulations make one that errs by 2 %."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """What held-out draws show: of each coordinate (d,), in the order of the space.

    `coverage` is the share of truths within the 95 % intervals, `ranks` (d, bins) counts the truths' ranks,
    and `rank_statistic` (d,) is their χ² against even counts, below `rank_limit` in 99 % of the cases.
    `median` and `p95` are those of the error of the means [%], the root of the sum of squares over the
    faults.
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
        """What χ² exceeds once in a hundred where the ranks are even."""
        return chi_squared_quantile(self.ranks.shape[1] - 1, 0.99)

    @property
    def poor(self) -> str | None:
        """Why the estimator is of little use, a clause; None where it is of use."""
        if self.median <= MOST_ERROR:
            return None
        return (
            f"poor: its answers err by {self.median:.3g} % (median), so that most recordings are searched; "
            "give more --simulations"
        )


def temperature_of(mixtures: list[Mixture], truths: Array) -> Array:
    """Return the factor (d,) of the standard deviations by which 95 % of `truths` (n, d) are covered."""
    means = np.array([one.mean for one in mixtures])
    deviations = np.array([np.sqrt(np.diag(one.covariance)) for one in mixtures])
    return np.asarray(np.quantile(np.abs(truths - means) / deviations, 0.95, axis=0) / Z95)


def judged(
    mixtures: list[Mixture], truths: Array, space: ParameterSpace, rng: np.random.Generator
) -> Judgement:
    """Return what the answers for draws with `truths` (n, d) show."""
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
