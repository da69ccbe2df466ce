"""Healthy runs that are not in an order by chance: they drift with it, or resemble the run before.

What is learned from runs that drift holds for between, not for later. Runs that resemble their neighbours are
not independent, and count for fewer: so where each file was taken for a run and several are cycles of one.
"""

import numpy as np

from emaphm.arrays import Array
from emaphm.detection.settings import DetectorSettings
from emaphm.detection.statistics import HealthyScatter
from emaphm.detection.thresholds import Labels
from emaphm.random_streams import stream

PERMUTATIONS = 10_000
"""By which an order is judged: all of 7 runs, and enough to know a probability of 1 % to a tenth."""

AT_ONCE = 1000
"""Of these, drawn together: some megabytes for a hundred runs."""

ROUNDING = 1e-9
"""Of a sum of products, relative: an order and its reverse have the same."""


def drifting_loads(
    features: Array, runs: Labels, loads: Labels, scatter: HealthyScatter, settings: DetectorSettings
) -> tuple[int, ...]:
    """Return the loads at which healthy runs drift, in the order in which they were given.

    The means of the runs along the first principal directions are compared with their order, by Spearman's
    rank correlation; a load drifts where one is significant at `drift_significance`, all tests taken together
    (Bonferroni). Its probability by chance is that among permutations: of few runs, that of the limit of many
    calls three times as many drifting as it says.

    Parameters
    ----------
    features
        Of all cycles, (n, p).
    runs, loads
        Which run, in their order, and load each is of, (n,).
    scatter
        Whose directions are looked at.
    """
    directions = scatter.directions[:, : settings.drift_directions]
    significance = settings.drift_significance / (np.unique(loads).size * directions.shape[1])
    drifting = []
    for load, means in _means(features, runs, loads, scatter, settings).items():
        # Rounding, so that runs without any difference have equal ranks.
        columns = [np.round(column, 9) for column in (means @ directions).T if np.ptp(column) > 1e-9]
        if any(drift_by_chance(column) < significance for column in columns):
            drifting.append(load)
    return tuple(drifting)


def serial_correlation(
    features: Array, runs: Labels, loads: Labels, scatter: HealthyScatter, settings: DetectorSettings
) -> float:
    """Return how much a healthy run resembles the one before it: a correlation from 0 to 1.

    A load counts where `likeness_by_chance` of the means of its runs, or of them along the first principal
    directions, is significant at `drift_significance`, all tests taken together (Bonferroni); its correlation
    is the largest lag-one autocorrelation along those directions. 0 where no load does. Arguments as in
    `drifting_loads`.
    """
    found, significance = 0.0, settings.drift_significance / (2 * np.unique(loads).size)
    for means in _means(features, runs, loads, scatter, settings).values():
        away = means - means.mean(axis=0)
        along = away @ scatter.directions[:, : settings.drift_directions]
        if min(likeness_by_chance(away), likeness_by_chance(along)) < significance:
            lag_one = np.sum(along[1:] * along[:-1], axis=0) / np.sum(along**2, axis=0)
            found = max(found, float(np.max(lag_one)))
    return found


def drift_by_chance(values: Array) -> float:
    """Return how often `values` (n,) in an order by chance go up or down as steadily as in theirs.

    By Spearman's rank correlation, in all permutations where they are no more than `PERMUTATIONS`, in as many
    drawn ones else.
    """
    from scipy.stats import permutation_test, rankdata

    order = np.arange(values.size) - (values.size - 1) / 2

    def steadiness(ranks: Array, axis: int = -1) -> Array:
        return np.asarray(np.abs(np.sum(np.moveaxis(ranks, axis, -1) * order, axis=-1)))

    found = permutation_test(
        (rankdata(values),),
        steadiness,
        permutation_type="pairings",
        alternative="greater",
        vectorized=True,
        n_resamples=PERMUTATIONS,
        rng=stream(0, "permutations of runs"),
    )
    return float(found.pvalue)


def likeness_by_chance(values: Array) -> float:
    """Return how often the rows of `values` (n, p), of mean 0, resemble the one before as much by chance.

    By the sum of the scalar products of successive rows, among `PERMUTATIONS` drawn ones and their own order.
    """
    products = values @ values.T
    random = stream(0, "orders of runs")
    own = float(np.diagonal(products, 1).sum())
    as_alike = 1
    for _ in range(PERMUTATIONS // AT_ONCE):
        orders = random.permuted(np.tile(np.arange(len(values)), (AT_ONCE, 1)), axis=1)
        drawn = products[orders[:, 1:], orders[:, :-1]].sum(axis=1)
        as_alike += int(np.count_nonzero(drawn >= own * (1 - ROUNDING)))
    return as_alike / (PERMUTATIONS + 1)


def _means(
    features: Array, runs: Labels, loads: Labels, scatter: HealthyScatter, settings: DetectorSettings
) -> dict[int, Array]:
    """Return the means of the runs at each load, (runs, p), relative to the healthy standard deviations.

    Of loads with enough runs to judge their order.
    """
    found = {}
    for load in np.unique(loads).tolist():
        order = np.unique(runs[loads == load])
        if order.size >= settings.fewest_runs:
            means = [features[(loads == load) & (runs == run)].mean(axis=0) for run in order]
            found[load] = np.stack(means) / scatter.scale
    return found
