"""Quantiles of the normal, Student's t and chi-squared distributions, and of a sample.

SciPy also has the quantiles of the distributions, but importing it takes longer than the search of a
diagnosis.
"""

import math
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike

from emaphm.arrays import Array

TOLERANCE = 1e-14
"""Relative step at which Newton's method ends."""


def normal_quantile(probability: ArrayLike) -> Array:
    """Return the standard normal quantiles of `probability` (any shape), each in (0, 1)."""
    inverse = NormalDist().inv_cdf
    given = np.asarray(probability, float)
    return np.array([inverse(float(p)) for p in given.ravel()]).reshape(given.shape)


def student_t_quantile(freedom: int, probability: float) -> float:
    """Return the quantile of Student's t with a whole number of degrees of freedom, at least 1.

    Newton's method on the distribution function, from the median on; the function is concave there, so no
    step overshoots.

    Parameters
    ----------
    freedom
        Degrees of freedom.
    probability
        In [0.5, 1).
    """
    t = 0.0
    for _ in range(200):
        step = (probability - student_t_distribution(freedom, t)) / _student_t_density(freedom, t)
        t += step
        if abs(step) <= TOLERANCE * abs(t):
            break
    return t


def student_t_distribution(freedom: int, t: float) -> float:
    """Return the probability that Student's t with a whole number of degrees of freedom is below `t`.

    The finite sums of Abramowitz and Stegun, 26.7.3 and 26.7.4, with θ = atan(t / √ν).
    """
    angle = math.atan2(t, math.sqrt(freedom))
    sin, square = math.sin(angle), math.cos(angle) ** 2
    odd = freedom % 2
    term = math.cos(angle) if odd else 1.0
    total = 0.0
    for k in range(1, freedom // 2 + 1):
        total += term
        term *= square * (2 * k / (2 * k + 1) if odd else (2 * k - 1) / (2 * k))
    within = 2 / math.pi * (angle + sin * total) if odd else sin * total
    return 0.5 * (1 + within)


def _student_t_density(freedom: int, t: float) -> float:
    half = 0.5 * (freedom + 1)
    scale = math.lgamma(half) - math.lgamma(0.5 * freedom) - 0.5 * math.log(freedom * math.pi)
    return math.exp(scale - half * math.log1p(t * t / freedom))


def chi_squared_quantile(freedom: float, probability: float) -> float:
    """Return the quantile of chi-squared with `freedom` degrees of freedom.

    For one degree of freedom exact, the square of a normal quantile; for more, accurate to 3 % (Wilson and
    Hilferty 1931).

    Parameters
    ----------
    freedom
        Degrees of freedom, at least 1.
    probability
        In [0.5, 1).
    """
    if freedom == 1:
        return float(normal_quantile(0.5 + 0.5 * probability)) ** 2
    spread = 2 / (9 * freedom)
    return freedom * (1 - spread + float(normal_quantile(probability)) * math.sqrt(spread)) ** 3


def sample_quantile(sample: Array, probability: float) -> float:
    """Return a quantile of a sample (n,) that may contain `inf`, as one of its values (inverted CDF)."""
    return float(np.quantile(sample, probability, method="inverted_cdf"))
