"""Healthy runs that change with their order: what is learned from them holds for between, not for later."""

import numpy as np

from emaphm.arrays import Array
from emaphm.detection.level import Level
from emaphm.detection.settings import DetectorSettings
from emaphm.detection.thresholds import Labels


def drifting_loads(
    features: Array, runs: Labels, loads: Labels, level: Level, settings: DetectorSettings
) -> tuple[int, ...]:
    """Return the loads at which healthy runs drift, in the order in which they were given.

    The means of the runs along the first principal directions are compared with their order, by Spearman's
    rank correlation; a load drifts where one is significant at `drift_significance`, all tests taken together
    (Bonferroni).

    Parameters
    ----------
    features
        Of all cycles, (n, p).
    runs, loads
        Which run, in their order, and load each is of, (n,).
    level
        Whose directions are looked at.
    """
    from scipy.stats import spearmanr

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
        ranks = [spearmanr(order, np.round(column, 9)) for column in along.T if np.ptp(column) > 1e-9]
        if any(one.pvalue < significance for one in ranks):
            drifting.append(load)
    return tuple(drifting)
