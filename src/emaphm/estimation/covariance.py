"""How sure an estimate is: standard errors from the Jacobian, the residual's autocorrelation allowed for.

Residuals of a good fit are still correlated over milliseconds, and larger at some times than at others:
ripple, friction, what the model leaves out. Least squares then seems surer than it is; a sandwich estimator
is not misled. Its middle part is the variance of the scores (derivatives times residual) at their lowest
frequencies (Müller 2007; Lazarus, Lewis, Stock and Watson 2018). A weak prior keeps what the data do not
constrain at its prior width instead of at infinity.
"""

from dataclasses import dataclass

import numpy as np
from scipy.fft import dct
from scipy.special import ndtri, stdtrit

from emaphm.arrays import Array
from emaphm.estimation.levenberg_marquardt import information

COSINES = 0.4
"""Cosine transforms, as a multiple of the samples to the power 2/3."""

LEAST_SPREAD = 1e-3
"""Of an estimate, as a share of what white residuals would make."""


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What a recording tells of an estimate, and what comes of it with a prior.

    `information` (d, d) is Fisher's, that of uncorrelated residuals; `covariance` (d, d) allows for their
    correlation, and for the prior.
    """

    information: Array
    covariance: Array


def knowledge(derivatives: Array, residual: Array, prior_deviation: Array, channels: int = 1) -> Knowledge:
    """Return what least squares know of an estimate.

    Parameters
    ----------
    derivatives
        Of the model's output with respect to each parameter, shape (d, rows); or several times that, each
        taken at a slightly other point, shape (n, d, rows).
    residual
        Recorded less model, shape (rows,).
    prior_deviation
        Standard deviation of each parameter before the data, shape (d,).
    channels
        Series of equal length that stand end to end in the rows; each residual has its own correlation.
    """
    several = derivatives[np.newaxis] if derivatives.ndim == 2 else derivatives
    # A perfect fit would make the information infinite: rounding leaves at least this much residual.
    rounding = 1e-20 * float(np.mean(several**2)) + np.finfo(float).tiny ** 0.25
    variance = max(float(np.mean(residual**2)), rounding)
    parts = np.split(several, channels, axis=2)
    fisher = np.sum([assured(part) for part in parts], axis=0) / variance
    # An estimate follows the mean derivatives: the noise of single ones is not its own.
    scores = several.mean(axis=0) * residual
    # What happens in several channels at once is one event: their scores of an instant belong together.
    spread = long_run(scores.reshape(len(scores), channels, -1).sum(axis=1)) / variance**2
    # Anticorrelated or perfect residuals leave next to no spread: no fit is that much better than white.
    spread = spread + LEAST_SPREAD * fisher
    prior = np.diag(1 / prior_deviation**2)
    # What the sandwich I⁻¹ S I⁻¹ is worth as information; where I is nothing, only the prior is left.
    worth = fisher @ np.linalg.pinv(spread, hermitian=True) @ fisher
    result = np.linalg.inv(worth + prior)
    return Knowledge(fisher, (result + result.T) / 2)


def assured(derivatives: Array) -> Array:
    """Return the `information` (d, d) of several derivatives (n, d, rows) that their noise cannot have made.

    Free of bias, it is still of either sign by chance where the data tell nothing. So a standard error
    is taken off along each of its axes, by the jackknife over the n points (Efron and Tibshirani 1993,
    ch. 11); of two points or one there is no telling, and nothing is.
    """
    found, count = information(derivatives), len(derivatives)
    if count <= 2:
        return found
    values, axes = np.linalg.eigh(found)
    products = np.array([along @ along.T for along in (axis @ derivatives for axis in axes.T)])
    squares = np.diagonal(products, axis1=1, axis2=2)
    total = products.sum(axis=(1, 2)) - squares.sum(axis=1)
    # Without one point, all pairs that it is part of are gone.
    without = total[:, np.newaxis] - 2 * (products.sum(axis=2) - squares)
    means = without / ((count - 1) * (count - 2))
    errors = np.sqrt((count - 1) * np.var(means, axis=1))
    return np.asarray(axes * np.maximum(values - errors, 0.0) @ axes.T)


def long_run(scores: Array) -> Array:
    """Return the covariance (d, d) of the sums of `scores` (d, samples), however they are correlated.

    By their first cosine transforms, which are uncorrelated and all of that covariance: as many as Lazarus
    et al. (2018) advise, and larger by what Student's t of so many is wider than the normal.
    """
    samples = scores.shape[1]
    count = max(1, int(COSINES * samples ** (2 / 3)))
    transforms = dct(scores, axis=1, norm="ortho")[:, 1 : count + 1]
    wider = stdtrit(count, 0.975) / ndtri(0.975)
    return np.asarray(wider**2 * samples / count * transforms @ transforms.T)
