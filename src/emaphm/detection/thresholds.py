"""Thresholds of a statistic, and how rare false alarms can be shown to be."""

import math

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array

Labels = NDArray[np.int64]

FEWEST_POSITIVE = 1e-300
"""Stands for a statistic of 0, which has no logarithm."""

LEAST_DEVIATION = 1e-6
"""Standard deviation of a statistic's logarithm where all healthy cycles are the same, as in simulations."""


FEWEST_INDEPENDENT = 3.0
"""Values that runs of which each resembles the one before are worth at least: Student's quantile of 1 % is 7
for them, and 32 for two."""


def joint_thresholds(scores: Array, runs: Labels, rate: float, likeness: float = 0.0) -> tuple[Array, float]:
    """Return what a further healthy cycle exceeds, in any of several statistics, with the probability `rate`.

    The logarithms of each statistic are brought to mean 0 and standard deviation 1; what counts is the
    largest of a cycle's, whose bound is that of `prediction_bound`. Statistics that go together cost no rate
    twice.

    Parameters
    ----------
    scores
        Of cycles left out of the training, (n, statistics), 0 or above.
    runs
        Which run each is of, (n,).
    rate
        Above 0, below 1.
    likeness
        Correlation r of a run with the one before it, from 0 to 1: as many values of an autoregressive series
        of first order are worth (1 - r) / (1 + r) of as many independent ones [1].

    Returns
    -------
    (statistics,), in their units, and how many independent values they rest on.

    References
    ----------
    [1] Bayley, Hammersley: The "effective" number of independent observations, J. R. Stat. Soc. 8, 1946.
    """
    logs = np.log(np.maximum(scores, FEWEST_POSITIVE))
    mean, deviation = logs.mean(axis=0), logs.std(axis=0, ddof=1)
    deviation = np.maximum(deviation, LEAST_DEVIATION)
    largest = ((logs - mean) / deviation).max(axis=1)
    number = effective_number(largest, runs)
    if likeness:
        number = max(number * (1 - likeness) / (1 + likeness), FEWEST_INDEPENDENT)
    bound = prediction_bound(largest, number, rate)
    return np.asarray(np.exp(mean + deviation * bound)), number


def prediction_bound(values: Array, number: float, rate: float) -> float:
    """Return what a further value exceeds with the probability `rate`, by a normal prediction interval.

        m + t s √(1 + 1/n)

    with mean m and standard deviation s of `values`, and Student's quantile t at 1 - rate for n - 1 degrees
    of freedom [1]; n is the `number` of independent values among them.

    References
    ----------
    [1] Hahn, Meeker: Statistical Intervals (Wiley, 1991), 4.7.
    """
    from scipy.stats import t

    factor = float(t.ppf(1 - rate, number - 1)) * math.sqrt(1 + 1 / number)
    return float(values.mean() + factor * values.std(ddof=1))


def effective_number(values: Array, runs: Labels) -> float:
    """Return how many independent values are worth as much as `values` (n,) of `runs` (n,), of g runs.

    With the correlation ρ between values of a run, by analysis of variance, and m values a run in the mean,
    it is n / (1 + (m - 1) ρ), between g and n [1].

    References
    ----------
    [1] Kish: Survey Sampling (Wiley, 1965), 5.4.
    """
    _, of, counts = np.unique(runs, return_inverse=True, return_counts=True)
    n, g = values.size, counts.size
    if n == g or g < 2:
        return float(g)
    means = np.bincount(of, values) / counts
    within = float(np.sum((values - means[of]) ** 2)) / (n - g)
    between = float(np.sum(counts * (means - values.mean()) ** 2)) / (g - 1)
    m = n / g
    total = between + (m - 1) * within
    correlation = min(max((between - within) / total, 0.0), 1.0) if total > 0 else 1.0
    return max(n / (1 + (m - 1) * correlation), float(g))


def highest_rate(alarms: int, of: int, confidence: float) -> float:
    """Return the upper bound on a rate of which `alarms` in `of` independent trials were seen.

    Exact binomial (Clopper and Pearson 1934), one-sided: 1 - (1 - confidence)^(1/of) where there were none.
    """
    from scipy.stats import beta

    return 1.0 if alarms >= of else float(beta.ppf(confidence, alarms + 1, of - alarms))


def runs_to_show(rate: float, confidence: float) -> int:
    """Return how many runs without an alarm would show at most `rate`."""
    return math.ceil(math.log(1 - confidence) / math.log(1 - rate))
