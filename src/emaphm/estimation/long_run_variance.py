"""The variance of a sum of correlated terms."""

import numpy as np
from scipy.fft import dct
from scipy.special import ndtri, stdtrit

from emaphm.arrays import Array

COSINES = 0.4
"""Cosine transforms used, as a multiple of the samples to the power 2/3 (Lazarus et al. 2018)."""


def long_run_covariance(scores: Array) -> Array:
    """Return the covariance (d, d) of the sums over `scores` (d, samples), correlated or not.

    From their cosine transforms of lowest frequency, which are uncorrelated and have all of that covariance
    (Müller 2007; Lazarus, Lewis, Stock and Watson 2018). It is larger by the square of the ratio of Student's
    t with as many degrees of freedom to the normal quantile, so that normal intervals have their coverage.
    """
    samples = scores.shape[1]
    count = max(1, int(COSINES * samples ** (2 / 3)))
    transforms = dct(scores, axis=1, norm="ortho")[:, 1 : count + 1]
    inflation = stdtrit(count, 0.975) / ndtri(0.975)
    return np.asarray(inflation**2 * samples / count * transforms @ transforms.T)
