"""The variance of sums of scores, where there are many parameters and few independent scores.

Of d parameters the long-run covariance has d (d + 1) / 2 numbers, from a few tens of transforms; derivatives
that act for a short time, as backlash does where motion reverses, leave even fewer independent scores. Then
some combination of parameters always seems to be known better than it is. Where the residual is white, the
covariance is known without them, up to a factor.
"""

import numpy as np

from emaphm.arrays import Array, rms
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

    That of `long_run_covariance` over b, the share of the scores' square that the fit leaves of a white
    residual. In units of what a white residual would make, chance alone spreads its eigenvalues about their
    mean. Those that it may have spread are drawn to their mean by `_shrunk`. Larger ones are of a correlated
    residual, and stay (a spiked covariance: Donoho, Gavish and Johnstone 2018).
    """
    sizes = np.repeat([_size(one) for one in np.split(residual, channels)], residual.size // channels)
    sized = jacobian * sizes
    found = long_run_covariance(jacobian * residual, channels)
    units, back = _white_units(sized @ sized.T)
    if not units.size:
        return found
    count, left, by_chance = _under_whiteness((units @ sized).reshape(len(units), channels, -1))
    found /= left
    values, axes = np.linalg.eigh(units @ found @ units.T)
    root = back @ axes
    return np.asarray(found + (root * (_shrunk(values, by_chance, count) - values)) @ root.T)


def _shrunk(values: Array, by_chance: float, count: int) -> Array:
    """Return eigenvalues (m,), in order, of which those that chance may have spread are drawn to their mean.

    Chance spreads them by `by_chance`, the expected sum of the squares of their relative distances from it,
    and up to (1 + √(by_chance / m))² times the mean (Marchenko and Pastur 1967). They are drawn by the part
    of the sum that is chance (Ledoit and Wolf 2004); the mean of n is of n times the `count` of transforms.
    """
    m = values.size
    edge = (1 + (by_chance / m) ** 0.5) ** 2
    n = next((n for n in range(m, 1, -1) if values[n - 1] <= edge * values[:n].mean()), 1)
    mean = max(float(np.mean(values[:n])), TINY)
    expected = float(by_chance * n * (n + 1) / (m * (m + 1)))
    distance = float(np.sum((values[:n] / mean - 1) ** 2))
    share = expected / max(expected, distance)
    steadier = (inflation(count * n) / inflation(count)) ** 2
    return np.concatenate([share * steadier * mean + (1 - share) * values[:n], values[n:]])


def _size(residual: Array) -> float:
    """Return the rms of a `residual` (rows,) in the rows that are compared: in others it is 0."""
    compared = residual[residual != 0]
    return max(rms(compared), TINY) if compared.size else TINY


def _under_whiteness(derivatives: Array) -> tuple[int, float, float]:
    """Return what a white residual makes of the mean square of the scores' transforms.

    `derivatives` (m, channels, samples) are orthonormal, so that the mean square is the unit matrix but for
    chance and for the fit. Returned are the number of transforms; the mean eigenvalue that the fit leaves;
    and the expected squared distance from the unit matrix, of normal residuals. The transforms y_k and y_l
    have the covariance G_kl = C_|k-l| + C_(k+l), C_j = Σ_t cos(π j (2 t + 1) / (2 n)) q_t q_tᵀ, and the fit
    takes 2 C_k² of that of y_k.
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


def _white_units(covariance: Array) -> tuple[Array, Array]:
    """Return what takes scores of a `covariance` (d, d) to uncorrelated ones of variance 1, and back."""
    sizes = np.sqrt(np.maximum(np.diag(covariance), TINY))
    values, axes = np.linalg.eigh(covariance / np.outer(sizes, sizes))
    known = values > LEAST_INFORMATION * values[-1]
    axes, roots = axes[:, known], np.sqrt(values[known])
    return np.asarray((axes / roots).T / sizes), np.asarray(sizes[:, np.newaxis] * axes * roots)
