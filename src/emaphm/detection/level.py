"""Scatter of healthy cycles, or of the means of healthy runs, with thresholds from runs left out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.detection.settings import DetectorSettings
from emaphm.detection.statistics import HealthyScatter
from emaphm.detection.thresholds import Labels, joint_thresholds


@dataclass(frozen=True, eq=False)
class Level:
    """What is judged together: one cycle, or the mean features of `cycles` or more.

    Attributes
    ----------
    cycles
        The least number that this level is for.
    scatter
        Of healthy ones.
    t2_threshold, q_threshold
        One of which a further healthy one exceeds with the rate of false alarms.
    energy
        Mean squared size of healthy whitened deviations, of runs left out.
    alarms, runs
        Runs left out of scatter and thresholds in which something exceeded them, and how many there were.
    """

    cycles: int
    scatter: HealthyScatter
    t2_threshold: float
    q_threshold: float
    energy: float
    alarms: int
    runs: int

    @property
    def name(self) -> str:
        """What is judged, in words."""
        return level_name(self.cycles)


def level_name(cycles: int) -> str:
    """Return what the level of that number of cycles judges, in words."""
    return "single cycles" if cycles == 1 else f"means of {cycles} cycles or more"


def learn_levels(
    features: Array, runs: Labels, loads: Labels, settings: DetectorSettings
) -> tuple[Level, ...]:
    """Return the level of single cycles, then those of means at numbers of cycles that enough runs have.

    Each is learned from the runs that have as many: a short run takes no level from the others. A number that
    is not twice that of the level before has none of its own. Arguments as in `learn_level`.
    """
    _, of, counts = np.unique(
        np.stack([runs, loads], axis=1), axis=0, return_inverse=True, return_counts=True
    )
    levels = [learn_level(features, runs, loads, 1, settings)]
    for cycles in np.unique(counts).tolist():
        taken = (counts >= cycles)[of]
        if cycles >= 2 * levels[-1].cycles and _enough(runs, loads, taken, settings):
            levels.append(learn_level(features[taken], runs[taken], loads[taken], cycles, settings))
    return tuple(levels)


def learn_level(
    features: Array, runs: Labels, loads: Labels, cycles: int, settings: DetectorSettings
) -> Level:
    """Return the scatter and the thresholds of healthy cycles, by cross-validation over runs.

    Parameters
    ----------
    features
        Of all cycles, (n, p).
    runs, loads
        Which run and load each is of, (n,).
    cycles
        1, or the number from which on the means of runs are judged.
    """
    # By load, so that runs at one load are in different folds: each fold leaves some of it to learn from.
    order = np.array(list(dict.fromkeys(runs[np.lexsort((runs, loads))].tolist())))
    fold_of = {run: place % settings.most_folds for place, run in enumerate(order.tolist())}
    folds = np.array([fold_of[run] for run in runs.tolist()])
    scores, energies, of_run = [], [], []
    for fold in np.unique(folds):
        left = folds == fold
        scatter = _scatter(features[~left], runs[~left], loads[~left], cycles, settings)
        centres = _centres(features, loads, ~left)
        deviations, run, _ = _together(features[left] - centres[left], runs[left], loads[left], cycles)
        scores.append(np.stack([scatter.t2(deviations), scatter.q(deviations)], axis=1))
        energies.append(np.sum(scatter.whitened(deviations) ** 2, axis=1))
        of_run.append(run)
    found, run = np.concatenate(scores), np.concatenate(of_run)
    rate = settings.false_alarm_rate
    thresholds = joint_thresholds(found, run, rate)
    alarms = sum(
        bool(np.any(found[run == one] > joint_thresholds(found[run != one], run[run != one], rate)))
        for one in order
    )
    scatter = _scatter(features, runs, loads, cycles, settings)
    energy = float(np.mean(np.concatenate(energies)))
    return Level(cycles, scatter, float(thresholds[0]), float(thresholds[1]), energy, alarms, order.size)


def _enough(runs: Labels, loads: Labels, taken: NDArray[np.bool_], settings: DetectorSettings) -> bool:
    """Return whether those `taken` (n,) are of enough runs for a level of their own.

    Of as many as a manoeuvre and each of its loads need, and of half of all: the wide threshold of a few
    runs hides more than the mean of their cycles shows.
    """
    at_loads = [np.unique(runs[taken & (loads == load)]).size for load in np.unique(loads)]
    found = np.unique(runs[taken]).size
    half = 2 * found >= np.unique(runs).size
    return half and found >= settings.fewest_runs and min(at_loads) >= settings.fewest_runs_of_load


def _scatter(
    features: Array, runs: Labels, loads: Labels, cycles: int, settings: DetectorSettings
) -> HealthyScatter:
    """Return the scatter of cycles, or of means: those are few, so cycles say half of how they vary."""
    everything = np.ones(len(features), dtype=bool)
    single = features - _centres(features, loads, everything)
    deviations, _, _ = _together(single, runs, loads, cycles)
    return HealthyScatter.learn(deviations, settings.variance_share, single if cycles > 1 else None)


def _centres(features: Array, loads: Labels, taken: NDArray[np.bool_]) -> Array:
    """Return, for each cycle, the mean features of those `taken` at its load, (n, p)."""
    means = np.zeros_like(features)
    for load in np.unique(loads):
        means[loads == load] = features[taken & (loads == load)].mean(axis=0)
    return means


def _together(deviations: Array, runs: Labels, loads: Labels, cycles: int) -> tuple[Array, Labels, Labels]:
    """Return what is judged: cycles as they are, or the mean of each run at each load; with both labels."""
    if cycles == 1:
        return deviations, runs, loads
    pairs, of = np.unique(np.stack([runs, loads], axis=1), axis=0, return_inverse=True)
    means = np.stack([deviations[of == k].mean(axis=0) for k in range(len(pairs))])
    return means, pairs[:, 0], pairs[:, 1]
