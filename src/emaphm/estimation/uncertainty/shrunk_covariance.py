"""The variance of sums of scores, where there are many parameters and few independent scores.

Of d parameters the long-run covariance has d (d + 1) / 2 numbers, from a few tens of transforms; derivatives
that act for a short time, as backlash does where motion reverses, leave even fewer independent scores. Then
some combination of parameters always seems to be known better than it is. Where the residual is white the
covariance is known without them, up to a factor.
"""

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.uncertainty.long_run_variance import (
    cosine_transforms,
    inflation,
    long_run_covariance,
    slow_transforms,
)

LEAST_INFORMATION = 1e-12
"""Information along an axis, relative to the largest, that is no more than rounding."""

TINY = float(np.finfo(float).tiny)


def shrunk_long_run_covariance(jacobian: Array, residual: Array, channels: int = 1) -> Array:
    """Return the long-run covariance (d, d) of scores `jacobian` (d, rows) times `residual` (rows,), shrunk.

    That of `long_run_covariance`, drawn towards what a white residual would make, W, as far as chance parts
    the two (Ledoit and Wolf 2004):

        S = a m W + (1 - a) S_found / b,    a = E |S_white - I|² / |S_found / (m b) - I|²,  1 at most,

    with matrices in units of W, m the mean eigenvalue of S_found / b, and b the share of the scores' square
    that the fit leaves of a white residual. E and b are those of normal residuals (`_under_whiteness`).
    """
    by_channel = np.split(residual, channels)
    sizes = np.repeat([max(float(np.std(one)), TINY) for one in by_channel], len(by_channel[0]))
    sized = jacobian * sizes
    white = sized @ sized.T
    found = long_run_covariance(jacobian * residual, channels)
    units = _whitening(white)
    m = len(units)
    if m == 0:
        return found
    count, left, by_chance = _under_whiteness((units @ sized).reshape(m, channels, -1))
    relative = units @ found @ units.T / (inflation(count) ** 2 * left)
    level = max(float(np.trace(relative)) / m, TINY)
    distance = float(np.sum((relative / level - np.eye(m)) ** 2))
    share = by_chance / max(by_chance, distance)
    return np.asarray(share * inflation(count * m) ** 2 * level * white + (1 - share) / left * found)


def _under_whiteness(derivatives: Array) -> tuple[int, float, float]:
    """Return what a white residual makes of the mean square of the scores' transforms.

    `derivatives` (m, channels, samples) are orthonormal, so that the mean square is the unit matrix but for
    chance and for the fit. Returned are the number of transforms; the mean eigenvalue that the fit leaves; and
    the expected squared distance from the unit matrix, of normal residuals. The transforms y_k and y_l have
    the covariance G_kl = C_|k-l| + C_(k+l), C_j = Σ_t cos(π j (2 t + 1) / (2 n)) q_t q_tᵀ, and the fit takes
    2 C_k² of that of y_k.
    """
    m, _, samples = derivatives.shape
    count = slow_transforms(np.zeros((1, samples))).shape[1]
    cosines = np.empty((m, m, 2 * count + 1))
    for row, one in zip(cosines, derivatives, strict=True):
        products = (one * derivatives).sum(axis=1)
        row[:, 0] = products.sum(axis=1)
        row[:, 1:] = np.sqrt(samples / 2) * cosine_transforms(products, 2 * count)
    taken = 2 * float(np.sum(cosines[:, :, 1 : count + 1] ** 2))
    whole = float(np.einsum("aak->", cosines[:, :, 2::2])) + count * m
    lags = np.arange(1, count + 1)
    by_chance = 0.0
    for k in lags:
        covariances = cosines[:, :, np.abs(k - lags)] + cosines[:, :, k + lags]
        by_chance += float(np.sum(np.einsum("aak->k", covariances) ** 2) + np.sum(covariances**2))
    return count, max((whole - taken) / (count * m), TINY), by_chance / count**2


def _whitening(covariance: Array) -> Array:
    """Return what takes scores of a `covariance` (d, d) to uncorrelated ones of variance 1, (m, d)."""
    sizes = np.sqrt(np.maximum(np.diag(covariance), TINY))
    values, axes = np.linalg.eigh(covariance / np.outer(sizes, sizes))
    known = values > LEAST_INFORMATION * values[-1]
    return np.asarray((axes[:, known] / np.sqrt(values[known])).T / sizes)
