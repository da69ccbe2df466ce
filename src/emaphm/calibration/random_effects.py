"""Combining what several recordings tell of the same parameters: weighted means, and what they scatter.

Estimates count by their precision. Where they scatter more than their standard errors say (Birge 1932:
the ratio of the two), the excess is a scatter between recordings, as of friction from day to day: a random
effect (DerSimonian and Laird 1986; Jackson, White and Thompson 2010). The next recording will have it too,
so the covariance is that of what the next recording may find, not that of the mean alone.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri, stdtrit

from emaphm.arrays import Array


@dataclass(frozen=True, eq=False)
class Combined:
    """The `mean` (p,), the `covariance` (p, p) of a next recording's parameters, and the scatter's size.

    `birge_ratio` is the scatter over what the standard errors say, about 1 where they are right; none where
    nothing was told twice.
    """

    mean: Array
    covariance: Array
    birge_ratio: float | None


def combine(estimates: Array, covariances: Array, prior_deviation: Array) -> Combined:
    """Return what `estimates` (n, p) with `covariances` (n, p, p) tell together.

    Each covariance holds the same weak prior of standard deviations `prior_deviation` (p,) about 0, which
    counts once. What an estimate does not tell has no weight.
    """
    count, p = estimates.shape
    prior = np.diag(1 / prior_deviation**2)
    worths = np.array([_positive(np.linalg.inv(one) - prior) for one in covariances])
    mean, covariance = _weighted(estimates, worths, prior)
    away = estimates - mean
    square = float(np.einsum("ni,nij,nj->", away, worths, away))
    freedom = float(np.einsum("nij,nji->", worths, covariances) - np.trace(worths.sum(axis=0) @ covariance))
    if count == 1 or freedom < LEAST_FREEDOM:
        return Combined(mean, covariance, None)
    ratio = square / freedom
    if ratio > 1:
        # The scatter of the mean's own terms, so that an estimate without weight does not count.
        terms = np.einsum("ij,njk,nk->ni", covariance, worths, away)
        scatter = count * count / (count - 1) * terms.T @ terms * (1 - 1 / ratio)
        # A deviation of few values is itself hardly known: the normal as wide as their Student's t.
        scatter *= (stdtrit(count - 1, 0.975) / ndtri(0.975)) ** 2
        worths = np.array([np.linalg.solve(np.eye(p) + one @ scatter, one) for one in worths])
        mean, covariance = _weighted(estimates, worths, prior)
        covariance = covariance + scatter
    return Combined(mean, (covariance + covariance.T) / 2, ratio**0.5)


LEAST_FREEDOM = 0.5
"""Parameters told more than once, with less of which there is no scatter to speak of."""


def _weighted(estimates: Array, worths: Array, prior: Array) -> tuple[Array, Array]:
    covariance = np.linalg.inv(worths.sum(axis=0) + prior)
    return covariance @ np.einsum("nij,nj->i", worths, estimates), covariance


def _positive(matrix: Array) -> Array:
    """Return a symmetric `matrix` (p, p) without what rounding made negative of it."""
    values, axes = np.linalg.eigh((matrix + matrix.T) / 2)
    return np.asarray(axes * np.maximum(values, 0.0) @ axes.T)
