"""Random-effects meta-analysis of the same parameters, estimated from several recordings.

Estimates are weighted by their precision. A scatter that exceeds their standard errors (Birge 1932: the ratio
of the two) is due to a scatter between recordings, for example of friction from day to day: a random effect
(DerSimonian and Laird 1986; Jackson, White and Thompson 2010). The next recording will also have this effect,
so the covariance is that of the next recording's parameters and not only that of the mean.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.uncertainty.fisher_information import positive_semidefinite
from emaphm.quantiles import chi_squared_quantile, normal_quantile, student_t_quantile

CHANCE = 0.2
"""Probability that a scatter due to errors alone counts as a scatter between the recordings. Without a test,
the scatter of a few estimates, widened by Student's t, would mostly be random; a scatter that the test misses
is no larger than the errors."""

LEAST_FREEDOM = 0.5
"""Least degrees of freedom of the scatter for a comparison."""


@dataclass(frozen=True, eq=False)
class MetaAnalysis:
    """The `mean` (p,), the `covariance` (p, p) of a next recording's parameters, and the Birge ratio.

    `scatter`, (p, p), is the part of that covariance due to the scatter between recordings; 0 if it is not
    significant. `birge_ratio` is the scatter relative to that expected from the standard errors, about 1 if
    these are correct; None if no parameter was estimated twice.
    """

    mean: Array
    covariance: Array
    scatter: Array
    birge_ratio: float | None


def random_effects(estimates: Array, covariances: Array, prior_deviation: Array) -> MetaAnalysis:
    """Return the common parameters of `estimates` (n, p) with `covariances` (n, p, p).

    Each covariance includes the same weak prior about 0 with standard deviations `prior_deviation` (p,),
    which counts once. An estimate has no weight in directions without information.
    """
    count, p = estimates.shape
    prior = np.diag(1 / prior_deviation**2)
    precisions = np.array(
        [positive_semidefinite(np.linalg.inv(covariance) - prior) for covariance in covariances]
    )
    mean, covariance = _weighted_mean(estimates, precisions, prior)
    deviations = estimates - mean
    square = float(np.einsum("ni,nij,nj->", deviations, precisions, deviations))
    freedom = float(
        np.einsum("nij,nji->", precisions, covariances) - np.trace(precisions.sum(axis=0) @ covariance)
    )
    if count == 1 or freedom < LEAST_FREEDOM:
        return MetaAnalysis(mean, covariance, np.zeros((p, p)), None)
    ratio, consistent = square / freedom, covariance
    if square > chi_squared_quantile(freedom, 1 - CHANCE):
        # The scatter of the terms of the mean, in which an estimate without weight does not count.
        terms = np.einsum("ij,njk,nk->ni", covariance, precisions, deviations)
        terms *= _scatter_per_term(np.einsum("ij,nji->ni", covariance, precisions))
        scatter = terms.T @ terms * (1 - 1 / ratio)
        precisions = np.array(
            [np.linalg.solve(np.eye(p) + precision @ scatter, precision) for precision in precisions]
        )
        mean, covariance = _weighted_mean(estimates, precisions, prior)
        covariance = covariance + scatter
    covariance = (covariance + covariance.T) / 2
    return MetaAnalysis(mean, covariance, covariance - (consistent + consistent.T) / 2, ratio**0.5)


def _scatter_per_term(weights: Array) -> Array:
    """Return the factors (p,) from the terms of a mean to the scatter of the estimates, root mean square.

    `weights` (n, p) are those of the n estimates in each parameter's mean. Of m equal weights 1/m, the sum of
    the squared terms has the mean (m - 1) / m² times the variance of the estimates; m is Kish's effective
    number (1965), at least 2. A variance of few values is itself uncertain: Student's t widens it.
    """
    squares = np.sum(weights**2, axis=0)
    count = np.sum(weights, axis=0) ** 2 / np.maximum(squares, np.finfo(float).tiny)
    count = np.maximum(count, 2.0)
    wider = np.array([student_t_quantile(round(m) - 1, 0.975) for m in count]) / float(normal_quantile(0.975))
    return np.asarray(count / np.sqrt(count - 1) * wider)


def _weighted_mean(estimates: Array, precisions: Array, prior: Array) -> tuple[Array, Array]:
    """Return the mean (p,) of `estimates` (n, p), weighted by `precisions` (n, p, p), and its covariance."""
    covariance = np.linalg.inv(precisions.sum(axis=0) + prior)
    return covariance @ np.einsum("nij,nj->i", precisions, estimates), covariance
