"""Healthy runs that change with their order: what is learned from them holds for between, not for later."""

import numpy as np

from emaphm.arrays import Array
from emaphm.detection.level import Level
from emaphm.detection.settings import DetectorSettings
from emaphm.detection.thresholds import Labels
from emaphm.random_streams import stream

PERMUTATIONS = 10_000
"""By which a drift is judged: all of 7 runs, and enough to know a probability of 1 % to a tenth."""


def drifting_loads(
    features: Array, runs: Labels, loads: Labels, level: Level, settings: DetectorSettings
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
    level
        Whose directions are looked at.
    """
    known = np.unique(loads)
    directions = level.scatter.directions[:, : settings.drift_directions]
    significance = settings.drift_significance / (known.size * directions.shape[1])
    drifting = []
    for load in known.tolist():
        order = np.unique(runs[loads == load])
        if order.size < settings.fewest_runs:
            continue
        means = [features[(loads == load) & (runs == run)].mean(axis=0) for run in order]
        along = (np.stack(means) / level.scatter.scale) @ directions
        # Rounding, so that runs without any difference have equal ranks.
        columns = [np.round(column, 9) for column in along.T if np.ptp(column) > 1e-9]
        if any(probability_by_chance(column) < significance for column in columns):
            drifting.append(load)
    return tuple(drifting)


def probability_by_chance(values: Array) -> float:
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
