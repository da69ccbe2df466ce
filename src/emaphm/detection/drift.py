"""Tests of the order of healthy runs: a drift with the order, and serial correlation of successive runs.

A detector learned from drifting runs holds for the time of these runs, not for later runs. Serially
correlated runs are not independent, and count as fewer runs. They occur if each file was taken as a run,
although several files are cycles of one run.
"""

import numpy as np

from emaphm.arrays import Array
from emaphm.detection.settings import DetectorSettings
from emaphm.detection.statistics import HealthyScatter
from emaphm.detection.thresholds import Labels
from emaphm.random_streams import stream

PERMUTATIONS = 10_000
"""Permutations of a test: all orders of up to 7 runs; a probability of 1 % is estimated to a tenth of it."""

AT_ONCE = 1000
"""Permutations that are drawn together: some megabytes for a hundred runs."""

ROUNDING = 1e-9
"""Relative rounding error of a sum of products: the sums of an order and of its reverse are equal."""


def drifting_loads(
    features: Array, runs: Labels, loads: Labels, scatter: HealthyScatter, settings: DetectorSettings
) -> tuple[int, ...]:
    """Return the loads at which healthy runs drift with the order in which they were given.

    The order of the runs is compared with their means along the first principal directions, by Spearman's
    rank correlation. A load drifts if one correlation is significant at `drift_significance`, for all tests
    together (Bonferroni). The probability by chance is computed from permutations: for few runs, the
    asymptotic distribution rejects three times as often as stated.

    Parameters
    ----------
    features
        Features of all cycles, (n, p).
    runs, loads
        Run (numbered in order) and load of each cycle, (n,).
    scatter
        Scatter of single cycles, whose first principal directions are tested.
    """
    directions = scatter.directions[:, : settings.drift_directions]
    significance = settings.drift_significance / (np.unique(loads).size * directions.shape[1])
    drifting = []
    for load, means in _means(features, runs, loads, scatter, settings).items():
        # Rounded, so that runs without any difference have equal ranks.
        columns = [np.round(column, 9) for column in (means @ directions).T if np.ptp(column) > 1e-9]
        if any(drift_by_chance(column) < significance for column in columns):
            drifting.append(load)
    return tuple(drifting)


def serial_correlation(
    features: Array, runs: Labels, loads: Labels, scatter: HealthyScatter, settings: DetectorSettings
) -> float:
    """Return the correlation, from 0 to 1, of a healthy run with the run before it.

    A load is serially correlated if `similarity_by_chance` of the means of its runs, or of their projections
    on the first principal directions, is significant at `drift_significance`, for all tests together
    (Bonferroni). Its correlation is the largest lag-one autocorrelation along these directions. The largest
    of all loads is returned, 0 if no load is serially correlated. Arguments as in `drifting_loads`.
    """
    correlation, significance = 0.0, settings.drift_significance / (2 * np.unique(loads).size)
    for means in _means(features, runs, loads, scatter, settings).values():
        centred = means - means.mean(axis=0)
        projected = centred @ scatter.directions[:, : settings.drift_directions]
        if min(similarity_by_chance(centred), similarity_by_chance(projected)) < significance:
            lag_one = np.sum(projected[1:] * projected[:-1], axis=0) / np.sum(projected**2, axis=0)
            correlation = max(correlation, float(np.max(lag_one)))
    return correlation


def drift_by_chance(values: Array) -> float:
    """Return the probability that `values` (n,) in a random order rise or fall as steadily as in theirs.

    The statistic is Spearman's rank correlation, over all permutations, or over `PERMUTATIONS` random ones if
    there are more.
    """
    from scipy.stats import permutation_test, rankdata

    order = np.arange(values.size) - (values.size - 1) / 2

    def steadiness(ranks: Array, axis: int = -1) -> Array:
        return np.asarray(np.abs(np.sum(np.moveaxis(ranks, axis, -1) * order, axis=-1)))

    test = permutation_test(
        (rankdata(values),),
        steadiness,
        permutation_type="pairings",
        alternative="greater",
        vectorized=True,
        n_resamples=PERMUTATIONS,
        rng=stream(0, "permutations of runs"),
    )
    return float(test.pvalue)


def similarity_by_chance(values: Array) -> float:
    """Return the probability that successive rows of `values` (n, p), of mean 0, are as similar by chance.

    The statistic is the sum of the scalar products of successive rows, over `PERMUTATIONS` random orders and
    the given one.
    """
    products = values @ values.T
    random = stream(0, "orders of runs")
    own = float(np.diagonal(products, 1).sum())
    as_similar = 1
    for _ in range(PERMUTATIONS // AT_ONCE):
        orders = random.permuted(np.tile(np.arange(len(values)), (AT_ONCE, 1)), axis=1)
        drawn = products[orders[:, 1:], orders[:, :-1]].sum(axis=1)
        as_similar += int(np.count_nonzero(drawn >= own * (1 - ROUNDING)))
    return as_similar / (PERMUTATIONS + 1)


def _means(
    features: Array, runs: Labels, loads: Labels, scatter: HealthyScatter, settings: DetectorSettings
) -> dict[int, Array]:
    """Return the means of the runs (runs, p), relative to the healthy standard deviations, by load.

    Loads with too few runs for a test of their order are left out.
    """
    by_load = {}
    for load in np.unique(loads).tolist():
        order = np.unique(runs[loads == load])
        if order.size >= settings.fewest_runs:
            means = [features[(loads == load) & (runs == run)].mean(axis=0) for run in order]
            by_load[load] = np.stack(means) / scatter.scale
    return by_load
