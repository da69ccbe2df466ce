"""Random-effects meta-analysis: the same parameters, estimated from several recordings.

Estimates count by their precision. Where they scatter more than their standard errors explain (Birge 1932:
the ratio of the two), the rest is a scatter between recordings, as of friction from day to day: a random
effect (DerSimonian and Laird 1986; Jackson, White and Thompson 2010). The next recording will have it too,
so the covariance is that of the next recording's parameters, not that of the mean alone.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.uncertainty.fisher_information import positive_semidefinite
from emaphm.quantiles import chi_squared_quantile, normal_quantile, student_t_quantile

CHANCE = 0.2
"""Probability with which errors alone make as large a scatter as is taken for one between the recordings.
The scatter of a few estimates, as wide as Student's t, would otherwise be mostly chance; one that is
overlooked is no larger than the errors."""

LEAST_FREEDOM = 0.5
"""Degrees of freedom of the scatter below which there is nothing to compare."""


@dataclass(frozen=True, eq=False)
class MetaAnalysis:
    """The `mean` (p,), the `covariance` (p, p) of a next recording's parameters, and the Birge ratio.

    `scatter`, (p, p), is what the recordings' scatter adds to that covariance; 0 where chance explains it.
    `birge_ratio` is the scatter relative to that expected from the standard errors, about 1 where they are
    right; None where no parameter was estimated twice.
    """

    mean: Array
    covariance: Array
    scatter: Array
    birge_ratio: float | None


def random_effects(estimates: Array, covariances: Array, prior_deviation: Array) -> MetaAnalysis:
    """Return the common parameters of `estimates` (n, p) with `covariances` (n, p, p).

    Each covariance includes the same weak prior of standard deviations `prior_deviation` (p,) about 0, which
    counts once. An estimate has no weight in the directions that it has no information on.
    """
    count, p = estimates.shape
    prior = np.diag(1 / prior_deviation**2)
    precisions = np.array([positive_semidefinite(np.linalg.inv(one) - prior) for one in covariances])
    mean, covariance = _weighted(estimates, precisions, prior)
    away = estimates - mean
    square = float(np.einsum("ni,nij,nj->", away, precisions, away))
    freedom = float(
        np.einsum("nij,nji->", precisions, covariances) - np.trace(precisions.sum(axis=0) @ covariance)
    )
    if count == 1 or freedom < LEAST_FREEDOM:
        return MetaAnalysis(mean, covariance, np.zeros((p, p)), None)
    ratio, consistent = square / freedom, covariance
    if square > chi_squared_quantile(freedom, 1 - CHANCE):
        # The scatter of the mean's own terms, so that an estimate without weight does not count.
        terms = np.einsum("ij,njk,nk->ni", covariance, precisions, away)
        scatter = count * count / (count - 1) * terms.T @ terms * (1 - 1 / ratio)
        # A variance of few values is itself uncertain: the normal as wide as their Student's t.
        scatter *= (student_t_quantile(count - 1, 0.975) / float(normal_quantile(0.975))) ** 2
        precisions = np.array([np.linalg.solve(np.eye(p) + one @ scatter, one) for one in precisions])
        mean, covariance = _weighted(estimates, precisions, prior)
        covariance = covariance + scatter
    covariance = (covariance + covariance.T) / 2
    return MetaAnalysis(mean, covariance, covariance - (consistent + consistent.T) / 2, ratio**0.5)


def _weighted(estimates: Array, precisions: Array, prior: Array) -> tuple[Array, Array]:
    covariance = np.linalg.inv(precisions.sum(axis=0) + prior)
    return covariance @ np.einsum("nij,nj->i", precisions, estimates), covariance
