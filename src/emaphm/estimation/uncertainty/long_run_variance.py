"""Long-run variance: the variance of a sum of correlated terms."""

import numpy as np

from emaphm.arrays import Array
from emaphm.quantiles import normal_quantile, student_t_quantile

COSINES = 0.4
"""Number of cosine transforms, as a multiple of the samples to the power 2/3 (Lazarus et al. 2018)."""


def long_run_covariance(scores: Array, channels: int = 1) -> Array:
    """Return the covariance (d, d) of the sums over correlated `scores` (d, rows).

    The rows are `channels` concatenated series of equal length. An event may appear in several channels:
    scores of the same instant are therefore added first.

    The covariance is estimated from the cosine transforms of lowest frequency, which are uncorrelated and
    contain all of that covariance (Müller 2007; Lazarus, Lewis, Stock and Watson 2018). It is multiplied by
    the square of the ratio of Student's t, with one degree of freedom per transform, to the normal quantile,
    so that normal intervals have their coverage.
    """
    summed = scores.reshape(len(scores), channels, -1).sum(axis=1)
    transforms = slow_transforms(summed)
    samples, count = summed.shape[1], transforms.shape[1]
    inflation = student_t_quantile(count, 0.975) / normal_quantile(0.975)
    return np.asarray(inflation**2 * samples / count * transforms @ transforms.T)


def slow_transforms(rows: Array) -> Array:
    """Return the cosine transforms (d, count) of `rows` (d, n) for the long-run covariance."""
    return cosine_transforms(rows, max(1, int(COSINES * rows.shape[1] ** (2 / 3))))


def cosine_transforms(rows: Array, count: int) -> Array:
    """Return the orthonormal cosine transforms 1 to `count` (at most half the samples) of `rows` (d, n).

    y_k = √(2/n) Σ x_i cos(π k (2 i + 1) / (2 n)), from the Fourier transform of the even samples followed by
    the odd ones in reverse (Makhoul 1980).
    """
    samples = rows.shape[1]
    reordered = np.concatenate([rows[:, ::2], rows[:, 1::2][:, ::-1]], axis=1)
    k = np.arange(1, count + 1)
    rotated = np.fft.rfft(reordered, axis=1)[:, k] * np.exp(-0.5j * np.pi * k / samples)
    return np.asarray(np.sqrt(2 / samples) * rotated.real)
