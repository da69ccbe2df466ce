"""How sure an estimate is: standard errors from the Jacobian, the residual's autocorrelation allowed for.

Residuals of a good fit are still correlated over milliseconds: ripple, friction, what the model leaves
out. Least squares then seems surer than it is; the sandwich estimator of Newey and West (1987) is not
misled. A weak prior keeps what the data do not constrain at its prior width instead of at infinity.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from emaphm.identification.refinement import information

Array = NDArray[np.float64]


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
    means = [part.mean(axis=0) for part in parts]
    series = zip(means, np.split(residual, channels), strict=True)
    spread = sum(mean @ _correlated(mean, left).T for mean, left in series) / variance**2
    # Anticorrelated or perfect residuals leave next to no spread: no fit is that much better than white.
    spread = spread + LEAST_SPREAD * fisher
    prior = np.diag(1 / prior_deviation**2)
    # What the sandwich I⁻¹ S I⁻¹ is worth as information; where I is nothing, only the prior is left.
    worth = fisher @ np.linalg.pinv(spread, hermitian=True) @ fisher
    result = np.linalg.inv(worth + prior)
    return Knowledge(fisher, (result + result.T) / 2)


def assured(derivatives: Array) -> Array:
    """Return the `information` (d, d) of several derivatives (n, d, rows) that their noise cannot have made.

    Free of bias, it is still of either sign by chance where the data tell nothing. So two standard errors
    are taken off along each of its axes, by the jackknife over the n points (Efron and Tibshirani 1993,
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
    return np.asarray(axes * np.maximum(values - 2 * errors, 0.0) @ axes.T)


def _correlated(derivatives: Array, residual: Array) -> Array:
    """Return the derivatives (d, samples) multiplied by the residual's autocovariance matrix.

    The sample autocovariance is tapered linearly (Bartlett), which keeps the matrix positive
    semidefinite; multiplying by a Toeplitz matrix is a convolution.
    """
    n = residual.size
    lags = bandwidth(residual)
    size = next_fast_len(n + lags)
    spectrum = np.abs(rfft(residual - residual.mean(), size)) ** 2
    autocovariance = irfft(spectrum, size)[: lags + 1] / n
    autocovariance[0] += residual.mean() ** 2
    taper = 1 - np.arange(lags + 1) / (lags + 1)
    kernel = np.zeros(size)
    kernel[: lags + 1] = autocovariance * taper
    kernel[size - lags :] = (autocovariance * taper)[:0:-1]
    product = irfft(rfft(derivatives, size, axis=1) * rfft(kernel), size, axis=1)
    return np.asarray(product[:, :n])


def bandwidth(residual: Array) -> int:
    """Return the number of lags over which the residual's autocorrelation counts.

    Andrews (1991), eq. 6.4, for the Bartlett taper and a first-order autoregression.
    """
    centred = residual - residual.mean()
    power = float(centred @ centred)
    rho = float(centred[1:] @ centred[:-1]) / power if power > 0 else 0.0
    rho = float(np.clip(rho, 0.0, 0.99))
    alpha = 4 * rho**2 / (1 - rho**2) ** 2
    lags = int(np.ceil(1.1447 * (alpha * residual.size) ** (1 / 3)))
    return int(np.clip(lags, 1, residual.size // 4))
