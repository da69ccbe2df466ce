"""Thresholds of a statistic, and how rare false alarms can be shown to be."""

import math

import numpy as np
from numpy.typing import ArrayLike

FEWEST_POSITIVE = 1e-300
"""Stands for a statistic of 0, which has no logarithm."""


def prediction_bound(scores: ArrayLike, groups: int, rate: float) -> float:
    """Return what a further healthy score exceeds with the probability `rate`.

    The logarithms of the scores are taken as normal; the bound is that of a prediction interval

        exp(m + t s √(1 + 1/g)),

    with their mean m and standard deviation s, and Student's quantile t at 1 - rate for g - 1 degrees of
    freedom [1]. A statistic of a chi² or F distribution has a lighter upper tail than its fitted lognormal,
    from about ten degrees of freedom on: the bound is then a little too high.

    Parameters
    ----------
    scores
        Of cycles left out of the training, (n,), above 0.
    groups
        g, independent runs that they come from: cycles of a run resemble each other.
    rate
        Above 0, below 1.

    References
    ----------
    [1] Hahn, Meeker: Statistical Intervals (Wiley, 1991), 4.7.
    """
    from scipy.stats import t

    logs = np.log(np.maximum(np.ravel(scores), FEWEST_POSITIVE))
    factor = float(t.ppf(1 - rate, groups - 1)) * math.sqrt(1 + 1 / groups)
    return float(np.exp(logs.mean() + factor * logs.std(ddof=1)))


def highest_rate(alarms: int, of: int, confidence: float) -> float:
    """Return the upper bound on a rate of which `alarms` in `of` independent trials were seen.

    Exact binomial (Clopper and Pearson 1934), one-sided: 1 - (1 - confidence)^(1/of) where there were none.
    """
    from scipy.stats import beta

    return 1.0 if alarms >= of else float(beta.ppf(confidence, alarms + 1, of - alarms))


def runs_to_show(rate: float, confidence: float) -> int:
    """Return how many runs without an alarm would show at most `rate`."""
    return math.ceil(math.log(1 - confidence) / math.log(1 - rate))
