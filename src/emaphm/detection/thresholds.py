"""Thresholds of statistics, and confidence bounds on the rate of false alarms."""

import math

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array

Labels = NDArray[np.int64]

FEWEST_POSITIVE = 1e-300
"""Replaces a statistic of 0, which has no logarithm."""

LEAST_DEVIATION = 1e-6
"""Least standard deviation of a statistic's logarithm, for simulated healthy cycles that are the same."""

FEWEST_INDEPENDENT = 3.0
"""Least number of independent values for serially correlated runs: Student's 99 % quantile is 7 for three
values, and 32 for two."""


def joint_thresholds(
    scores: Array, runs: Labels, rate: float, correlation: float = 0.0
) -> tuple[Array, float]:
    """Return thresholds of several statistics, and the number of independent values they are computed from.

    A further healthy cycle exceeds at least one of them with the probability `rate`. The logarithms of each
    statistic are standardised; the bound of the largest in a cycle is that of `prediction_bound`. Correlated
    statistics therefore do not increase the rate.

    Parameters
    ----------
    scores
        Statistics of cycles left out of the training, (n, statistics), not negative.
    runs
        Run of each cycle, (n,).
    rate
        Probability of a false alarm, between 0 and 1.
    correlation
        Correlation r of a run with the run before it, from 0 to 1: n values of a first-order autoregressive
        series have the information of n (1 - r) / (1 + r) independent values [1].

    Returns
    -------
    Thresholds (statistics,), in the statistics' units, and the number of independent values.

    References
    ----------
    [1] Bayley, Hammersley: The "effective" number of independent observations, J. R. Stat. Soc. 8, 1946.
    """
    logs = np.log(np.maximum(scores, FEWEST_POSITIVE))
    mean, deviation = logs.mean(axis=0), logs.std(axis=0, ddof=1)
    deviation = np.maximum(deviation, LEAST_DEVIATION)
    largest = ((logs - mean) / deviation).max(axis=1)
    number = effective_number(largest, runs)
    if correlation:
        number = max(number * (1 - correlation) / (1 + correlation), FEWEST_INDEPENDENT)
    bound = prediction_bound(largest, number, rate)
    with np.errstate(over="ignore"):  # an extreme rate has an infinite threshold
        return np.asarray(np.exp(mean + deviation * bound)), number


def prediction_bound(values: Array, number: float, rate: float) -> float:
    """Return the upper prediction bound, which a further normal value exceeds with the probability `rate`.

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
    """Return the effective number of independent values among `values` (n,), which are of `runs` (n,).

    With g runs, the correlation ρ between values of a run, by analysis of variance, and the mean number m of
    values in a run, it is n / (1 + (m - 1) ρ), between g and n [1].

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
    """Return the upper confidence bound on a rate, from `alarms` in `of` independent trials.

    It is the exact one-sided binomial bound (Clopper and Pearson 1934): 1 - (1 - confidence)^(1/of) without
    an alarm.
    """
    from scipy.stats import beta

    return 1.0 if alarms >= of else float(beta.ppf(confidence, alarms + 1, of - alarms))


def runs_to_show(rate: float, confidence: float) -> int:
    """Return the number of runs without an alarm for which the bound of `highest_rate` is at most `rate`."""
    return math.ceil(math.log(1 - confidence) / math.log(1 - rate))
