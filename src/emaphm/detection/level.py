"""Levels of a detector: scatter of healthy cycles or of means of runs, with cross-validated thresholds."""

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
from emaphm.errors import MethodError

Selection = NDArray[np.bool_]

LEAST_RATIO = 1.25
"""Ratio of the independent values of single cycles and of means above which a mean is judged by the scatter
of single cycles too. If the cycles of a run are nearly the same, this would repeat the same comparison, and
two thresholds have more false alarms than one."""


@dataclass(frozen=True, eq=False)
class Level:
    """Scatter and thresholds of single cycles, or of the mean features of `cycles` cycles or more.

    Attributes
    ----------
    cycles
        Least number of cycles in a mean of this level; 1 for single cycles.
    scatter
        Scatter of healthy cycles or means.
    t2_threshold, q_threshold
        Thresholds: the probability that a further healthy cycle or mean exceeds one of them is the rate of
        false alarms.
    energy
        Mean squared length of healthy whitened deviations, of runs left out.
    alarms, runs
        Number of runs with an alarm when left out of scatter and thresholds, and number of all runs. The mean
        of a run may also alarm by the thresholds of single cycles.
    independent
        Number of independent values from which the thresholds are computed: between the numbers of runs and
        of cycles, or fewer if successive runs are correlated.
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
        """The level in words, "single cycles" for instance."""
        return level_name(self.cycles)

    def excess(self, deviations: Array) -> Array:
        """Return the larger of T² and Q of `deviations` (n, p), each relative to its threshold: (n,)."""
        return np.asarray(
            np.maximum(
                self.scatter.t2(deviations) / self.t2_threshold,
                self.scatter.q(deviations) / self.q_threshold,
            )
        )


def level_and_judge(levels: Sequence[Level], deviation: Array, cycles: int) -> tuple[Level, Level]:
    """Return the level of means of `cycles`, and the level with the larger excess of `deviation` (1, p).

    The second is the first, or the level of single cycles: a mean scatters no more than a single cycle, and
    with few runs the thresholds of means are wider than those of the more numerous cycles.
    """
    single, means = levels[0], [level for level in levels if level.cycles <= cycles][-1]
    if not _singles_judge(single.independent, means.independent):
        return means, means
    return means, max((means, single), key=lambda level: float(level.excess(deviation)[0]))


def _singles_judge(of_singles: float, of_means: float) -> bool:
    """Return whether a mean is judged by single cycles too, from the independent values of both levels."""
    return of_singles > LEAST_RATIO * of_means


def level_name(cycles: int) -> str:
    """Return the level of means of `cycles` in words."""
    return "single cycles" if cycles == 1 else f"means of {cycles} cycles or more"


def learn_levels(
    features: Array, runs: Labels, loads: Labels, settings: DetectorSettings
) -> tuple[Level, ...]:
    """Return the level of single cycles, then the levels of means.

    There is a level of means for each number of cycles that enough runs have, and which is at least twice
    that of the level before. It is learned from the runs with at least this number of cycles, so that a short
    run does not remove a level.

    Parameters
    ----------
    features
        Features of all cycles, (n, p).
    runs, loads
        Run and load of each cycle, (n,).
    """
    _, pair_of, counts = np.unique(
        np.stack([runs, loads], axis=1), axis=0, return_inverse=True, return_counts=True
    )
    healthy, correlation = _Healthy(features, runs, loads, settings), 0.0
    if np.unique(runs).size == len(features):  # also the case if the runs of the cycles were not stated
        correlation = serial_correlation(features, runs, loads, healthy.scatter(1), settings)
    singles = _left_out_scores(healthy, 1, correlation)
    levels = [_level(healthy, 1, singles, singles)]
    for cycles in np.unique(counts).tolist():
        selected = (counts >= cycles)[pair_of]
        if cycles >= 2 * levels[-1].cycles and _enough_runs(runs, loads, selected, settings):
            part = healthy if selected.all() else healthy.part(selected)
            levels.append(_level(part, cycles, _left_out_scores(part, cycles, correlation), singles))
    return tuple(levels)


@dataclass(frozen=True, eq=False)
class _Healthy:
    """Healthy cycles: their features (n, p), and the run and the load of each, (n,).

    The scatter of single cycles is cached, because all levels need it.
    """

    features: Array
    runs: Labels
    loads: Labels
    settings: DetectorSettings

    def part(self, selected: Selection) -> "_Healthy":
        """Return the `selected` cycles (n,)."""
        return _Healthy(self.features[selected], self.runs[selected], self.loads[selected], self.settings)

    def scatter(self, cycles: int) -> HealthyScatter:
        """Return the scatter of single cycles, or of the means of runs."""
        if cycles == 1:
            return self._scatter_of_singles
        # There are few means, so their correlations are averaged with those of single cycles.
        means, _, _ = _pooled(self._deviations, self.runs, self.loads, cycles)
        scale, correlations = shrunk_correlations(means)
        averaged = (correlations + self._correlations[1]) / 2
        return HealthyScatter.of(scale, averaged, self.settings.variance_share)

    @cached_property
    def folds(self) -> list[tuple[Selection, "_Healthy"]]:
        """The cycles that each fold leaves out, (n,), and the other cycles.

        Runs at one load are in different folds, so that some runs at each load remain to learn from.
        """
        order = np.array(list(dict.fromkeys(self.runs[np.lexsort((self.runs, self.loads))].tolist())))
        fold_of = {run: k % self.settings.most_folds for k, run in enumerate(order.tolist())}
        folds = np.array([fold_of[run] for run in self.runs.tolist()])
        return [(folds == fold, self.part(folds != fold)) for fold in np.unique(folds)]

    @cached_property
    def _deviations(self) -> Array:
        all_cycles = np.ones(len(self.features), dtype=bool)
        return self.features - _centres(self.features, self.loads, all_cycles)

    @cached_property
    def _correlations(self) -> tuple[Array, Array]:
        return shrunk_correlations(self._deviations)

    @cached_property
    def _scatter_of_singles(self) -> HealthyScatter:
        return HealthyScatter.of(*self._correlations, self.settings.variance_share)


@dataclass(frozen=True, eq=False)
class _LeftOutScores:
    """T² and Q of cycles or means, (n, 2), by the scatter of runs in other folds, and their runs, (n,).

    `by_single`, (n, 2), are T² and Q by the scatter of single cycles. `energies`, (n,), are the squared
    lengths of the whitened deviations. `correlation` is that of a run with the run before it, `rate` that of
    false alarms.
    """

    scores: Array
    by_single: Array
    energies: Array
    runs: Labels
    correlation: float
    rate: float

    def thresholds(self, without: int | None = None) -> tuple[Array, float]:
        """Return the thresholds of T² and Q, (2,), and the number of values, without the run `without`."""
        selected = self.runs != without
        return joint_thresholds(self.scores[selected], self.runs[selected], self.rate, self.correlation)

    @cached_property
    def thresholds_without(self) -> dict[int, tuple[Array, float]]:
        """The `thresholds` without each run, cached because all levels need those of single cycles."""
        return {run: self.thresholds(run) for run in np.unique(self.runs).tolist()}


def _left_out_scores(healthy: _Healthy, cycles: int, correlation: float) -> _LeftOutScores:
    """Return the statistics of healthy cycles, or of means of runs, by cross-validation over runs."""
    features, runs, loads = healthy.features, healthy.runs, healthy.loads
    scores, by_single, energies, scored_runs = [], [], [], []
    for out, remaining in healthy.folds:
        scatter, single = remaining.scatter(cycles), remaining.scatter(1)
        centres = _centres(features, loads, ~out)
        deviations, run, _ = _pooled(features[out] - centres[out], runs[out], loads[out], cycles)
        scores.append(np.stack([scatter.t2(deviations), scatter.q(deviations)], axis=1))
        by_single.append(np.stack([single.t2(deviations), single.q(deviations)], axis=1))
        energies.append(np.sum(scatter.whitened(deviations) ** 2, axis=1))
        scored_runs.append(run)
    return _LeftOutScores(
        np.concatenate(scores),
        np.concatenate(by_single),
        np.concatenate(energies),
        np.concatenate(scored_runs),
        correlation,
        healthy.settings.false_alarm_rate,
    )


def _level(healthy: _Healthy, cycles: int, scores: _LeftOutScores, singles: _LeftOutScores) -> Level:
    """Return the level of healthy cycles, or of means, with thresholds from their left-out `scores`.

    `MethodError` if a threshold is infinite or 0: the rate of false alarms is extreme for so few runs.
    """
    thresholds, number = scores.thresholds()
    if not np.all(np.isfinite(thresholds) & (thresholds > 0)):
        raise MethodError(
            f"a rate of false alarms of {scores.rate:g} has no threshold with {number:.2g} independent "
            "healthy runs; give a rate nearer to 0.01, or more runs"
        )
    runs = scores.thresholds_without
    alarms = sum(_alarms_left_out(run, scores, singles) for run in runs)
    energy = float(np.mean(scores.energies))
    t2, q = thresholds.tolist()
    return Level(
        cycles=cycles,
        scatter=healthy.scatter(cycles),
        t2_threshold=t2,
        q_threshold=q,
        energy=energy,
        alarms=alarms,
        runs=len(runs),
        independent=number,
    )


def _alarms_left_out(run: int, scores: _LeftOutScores, singles: _LeftOutScores) -> bool:
    """Return whether a run exceeds thresholds without it: those of its level, or of single cycles."""
    own = scores.runs == run
    own_thresholds, number = scores.thresholds_without[run]
    single_thresholds, number_of_singles = singles.thresholds_without[run]
    alarms = np.any(scores.scores[own] > own_thresholds)
    if _singles_judge(number_of_singles, number):
        alarms = alarms or np.any(scores.by_single[own] > single_thresholds)
    return bool(alarms)


def _enough_runs(runs: Labels, loads: Labels, selected: Selection, settings: DetectorSettings) -> bool:
    """Return whether the `selected` cycles (n,) are of enough runs for a level.

    These are the numbers of runs that a manoeuvre and each of its loads need, and half of all runs: the wide
    threshold of a few runs costs more sensitivity than the mean of their cycles gains.
    """
    at_loads = [np.unique(runs[selected & (loads == load)]).size for load in np.unique(loads)]
    number = np.unique(runs[selected]).size
    half = 2 * number >= np.unique(runs).size
    return half and number >= settings.fewest_runs and min(at_loads) >= settings.fewest_runs_of_load


def _centres(features: Array, loads: Labels, selected: Selection) -> Array:
    """Return, for each cycle, the mean features of the `selected` cycles at its load, (n, p)."""
    means = np.zeros_like(features)
    for load in np.unique(loads):
        means[loads == load] = features[selected & (loads == load)].mean(axis=0)
    return means


def _pooled(deviations: Array, runs: Labels, loads: Labels, cycles: int) -> tuple[Array, Labels, Labels]:
    """Return the cycles if `cycles` is 1, else the mean of each run at each load; with runs and loads."""
    if cycles == 1:
        return deviations, runs, loads
    pairs, pair_of = np.unique(np.stack([runs, loads], axis=1), axis=0, return_inverse=True)
    means = np.stack([deviations[pair_of == k].mean(axis=0) for k in range(len(pairs))])
    return means, pairs[:, 0], pairs[:, 1]
