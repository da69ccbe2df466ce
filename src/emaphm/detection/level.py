"""Scatter of healthy cycles, or of the means of healthy runs, with thresholds from runs left out."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.detection.drift import serial_correlation
from emaphm.detection.settings import DetectorSettings
from emaphm.detection.statistics import HealthyScatter, shrunk_correlations
from emaphm.detection.thresholds import Labels, joint_thresholds

MORE = 1.25
"""Ratio of independent values from which single cycles judge a mean too: where the cycles of a run are
nearly the same, they would say the same again, and two thresholds have more false alarms than one."""


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
        Runs left out of scatter and thresholds in which something exceeded them, and how many there were. The
        mean of a run alarms by the thresholds of single cycles too.
    independent
        How many independent values the thresholds rest on: between the number of runs and that of cycles, or
        fewer where runs resemble those before them.
    """

    cycles: int
    scatter: HealthyScatter
    t2_threshold: float
    q_threshold: float
    energy: float
    alarms: int
    runs: int
    independent: float

    @property
    def name(self) -> str:
        """What is judged, in words."""
        return level_name(self.cycles)

    def excess(self, deviations: Array) -> Array:
        """Return the larger of T² and Q of `deviations` (n, p), each relative to its threshold: (n,)."""
        return np.asarray(
            np.maximum(
                self.scatter.t2(deviations) / self.t2_threshold,
                self.scatter.q(deviations) / self.q_threshold,
            )
        )


def judging(levels: Sequence[Level], deviation: Array, cycles: int) -> tuple[Level, Level]:
    """Return the level of means of `cycles`, and that by which the `deviation` (1, p) of one is farthest off.

    The same, or that of single cycles: a mean scatters no more than a cycle, and of few runs the thresholds
    of means are wider than those of the many cycles.
    """
    single, means = levels[0], [one for one in levels if one.cycles <= cycles][-1]
    if not _singles_judge(single.independent, means.independent):
        return means, means
    return means, max((means, single), key=lambda one: float(one.excess(deviation)[0]))


def _singles_judge(of_singles: float, of_means: float) -> bool:
    """Return whether single cycles judge a mean too, by how many independent values each level rests on."""
    return of_singles > MORE * of_means


def level_name(cycles: int) -> str:
    """Return what the level of that number of cycles judges, in words."""
    return "single cycles" if cycles == 1 else f"means of {cycles} cycles or more"


def learn_levels(
    features: Array, runs: Labels, loads: Labels, settings: DetectorSettings
) -> tuple[Level, ...]:
    """Return the level of single cycles, then those of means at numbers of cycles that enough runs have.

    Each is learned from the runs that have as many: a short run takes no level from the others. A number that
    is not twice that of the level before has none of its own.

    Parameters
    ----------
    features
        Of all cycles, (n, p).
    runs, loads
        Which run and load each is of, (n,).
    """
    _, of, counts = np.unique(
        np.stack([runs, loads], axis=1), axis=0, return_inverse=True, return_counts=True
    )
    healthy, likeness = _Healthy(features, runs, loads, settings), 0.0
    if np.unique(runs).size == len(features):  # as where nobody has said which are cycles of one run
        likeness = serial_correlation(features, runs, loads, healthy.scatter(1), settings)
    singles = _left_out_scores(healthy, 1, likeness)
    levels = [_level(healthy, 1, singles, singles)]
    for cycles in np.unique(counts).tolist():
        taken = (counts >= cycles)[of]
        if cycles >= 2 * levels[-1].cycles and _enough(runs, loads, taken, settings):
            those = healthy if taken.all() else healthy.part(taken)
            levels.append(_level(those, cycles, _left_out_scores(those, cycles, likeness), singles))
    return tuple(levels)


@dataclass(frozen=True, eq=False)
class _Healthy:
    """Healthy cycles by their features (n, p), with the run and the load of each, (n,).

    What is known of single cycles is kept: every level asks for it.
    """

    features: Array
    runs: Labels
    loads: Labels
    settings: DetectorSettings

    def part(self, taken: NDArray[np.bool_]) -> "_Healthy":
        """Return those `taken` (n,)."""
        return _Healthy(self.features[taken], self.runs[taken], self.loads[taken], self.settings)

    def scatter(self, cycles: int) -> HealthyScatter:
        """Return the scatter of cycles, or of means: those are few, so cycles say half of how they vary."""
        if cycles == 1:
            return self._of_singles
        means, _, _ = _together(self._deviations, self.runs, self.loads, cycles)
        scale, correlations = shrunk_correlations(means)
        both = (correlations + self._correlations[1]) / 2
        return HealthyScatter.of(scale, both, self.settings.variance_share)

    @cached_property
    def folds(self) -> list[tuple[NDArray[np.bool_], "_Healthy"]]:
        """What each fold leaves out, (n,), and the rest.

        By load, so that runs at one load are in different folds: each fold leaves some of it to learn from.
        """
        order = np.array(list(dict.fromkeys(self.runs[np.lexsort((self.runs, self.loads))].tolist())))
        fold_of = {run: place % self.settings.most_folds for place, run in enumerate(order.tolist())}
        folds = np.array([fold_of[run] for run in self.runs.tolist()])
        return [(folds == fold, self.part(folds != fold)) for fold in np.unique(folds)]

    @cached_property
    def _deviations(self) -> Array:
        everything = np.ones(len(self.features), dtype=bool)
        return self.features - _centres(self.features, self.loads, everything)

    @cached_property
    def _correlations(self) -> tuple[Array, Array]:
        return shrunk_correlations(self._deviations)

    @cached_property
    def _of_singles(self) -> HealthyScatter:
        return HealthyScatter.of(*self._correlations, self.settings.variance_share)


@dataclass(frozen=True, eq=False)
class _LeftOutScores:
    """T² and Q of what is judged together, (n, 2), each by runs of other folds, and the run of each, (n,).

    `by_single`, (n, 2), are those by the scatter of single cycles; `energies`, (n,), the squared sizes of the
    whitened deviations; `likeness` is the correlation of a run with the one before it, and `rate` that of
    false alarms.
    """

    scores: Array
    by_single: Array
    energies: Array
    runs: Labels
    likeness: float
    rate: float

    def thresholds(self, without: int | None = None) -> tuple[Array, float]:
        """Return those of T² and Q, (2,), from all runs or without one, and how many values they rest on."""
        taken = self.runs != without
        return joint_thresholds(self.scores[taken], self.runs[taken], self.rate, self.likeness)

    @cached_property
    def thresholds_without(self) -> dict[int, tuple[Array, float]]:
        """The `thresholds` without each run: those of single cycles are asked for by every level."""
        return {run: self.thresholds(run) for run in np.unique(self.runs).tolist()}


def _left_out_scores(healthy: _Healthy, cycles: int, likeness: float) -> _LeftOutScores:
    """Return the statistics of healthy cycles, or of means of runs, by cross-validation over runs."""
    features, runs, loads = healthy.features, healthy.runs, healthy.loads
    scores, by_single, energies, of_run = [], [], [], []
    for left, rest in healthy.folds:
        scatter, single = rest.scatter(cycles), rest.scatter(1)
        centres = _centres(features, loads, ~left)
        deviations, run, _ = _together(features[left] - centres[left], runs[left], loads[left], cycles)
        scores.append(np.stack([scatter.t2(deviations), scatter.q(deviations)], axis=1))
        by_single.append(np.stack([single.t2(deviations), single.q(deviations)], axis=1))
        energies.append(np.sum(scatter.whitened(deviations) ** 2, axis=1))
        of_run.append(run)
    return _LeftOutScores(
        np.concatenate(scores),
        np.concatenate(by_single),
        np.concatenate(energies),
        np.concatenate(of_run),
        likeness,
        healthy.settings.false_alarm_rate,
    )


def _level(healthy: _Healthy, cycles: int, found: _LeftOutScores, singles: _LeftOutScores) -> Level:
    """Return the scatter and thresholds of healthy cycles, or of means, by their scores left out."""
    thresholds, number = found.thresholds()
    every = found.thresholds_without
    alarms = sum(_alarms_left_out(run, found, singles) for run in every)
    energy = float(np.mean(found.energies))
    t2, q = thresholds.tolist()
    return Level(
        cycles=cycles,
        scatter=healthy.scatter(cycles),
        t2_threshold=t2,
        q_threshold=q,
        energy=energy,
        alarms=alarms,
        runs=len(every),
        independent=number,
    )


def _alarms_left_out(run: int, found: _LeftOutScores, singles: _LeftOutScores) -> bool:
    """Return whether a run exceeds thresholds without it: its level's, or those of single cycles."""
    own = found.runs == run
    by_own, number = found.thresholds_without[run]
    by_single, of_singles = singles.thresholds_without[run]
    alarms = np.any(found.scores[own] > by_own)
    if _singles_judge(of_singles, number):
        alarms = alarms or np.any(found.by_single[own] > by_single)
    return bool(alarms)


def _enough(runs: Labels, loads: Labels, taken: NDArray[np.bool_], settings: DetectorSettings) -> bool:
    """Return whether those `taken` (n,) are of enough runs for a level of their own.

    Of as many as a manoeuvre and each of its loads need, and of half of all: the wide threshold of a few
    runs hides more than the mean of their cycles shows.
    """
    at_loads = [np.unique(runs[taken & (loads == load)]).size for load in np.unique(loads)]
    found = np.unique(runs[taken]).size
    half = 2 * found >= np.unique(runs).size
    return half and found >= settings.fewest_runs and min(at_loads) >= settings.fewest_runs_of_load


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
