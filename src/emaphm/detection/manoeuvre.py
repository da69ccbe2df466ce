"""Healthy cycles of one manoeuvre: their mean at each load, their features and their scatter."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array, rms
from emaphm.detection.cycle import Cycle, with_nearest
from emaphm.detection.drift import drifting_loads
from emaphm.detection.features import features_of
from emaphm.detection.level import Level, learn_levels
from emaphm.detection.segments import StrokeSegment, segments_of
from emaphm.detection.settings import DetectorSettings
from emaphm.errors import RecordingError
from emaphm.recording.noise import robust_noise_level

Groups = NDArray[np.int64]

LOAD_NOISE = 3.0
"""Largest rms difference of two recordings of one load, in units of their noise; white noise makes it 1."""

LEAST_SCALE = 1e-9
"""Least scatter of a channel, relative to its largest value; rounding alone causes more."""


@dataclass(frozen=True, eq=False)
class HealthyAtLoad:
    """Healthy cycles at one load.

    Attributes
    ----------
    load
        Load (rows,) [N·m or N]; 0 if none was recorded.
    mean
        Mean cycle (rows, channels), in the channels' units.
    centre
        Mean features (features,) of the residuals of healthy cycles.
    recorded
        Whether at least one of the cycles has a recorded load.
    """

    load: Array
    mean: Array
    centre: Array
    recorded: bool

    @property
    def name(self) -> str:
        """The load in words."""
        if not self.recorded:
            return "load not recorded"
        low, high = float(self.load.min()), float(self.load.max())
        return (
            f"load {low:.4g}"
            if high - low <= 1e-3 * max(abs(low), abs(high))
            else (f"load {low:.4g} to {high:.4g}")
        )


@dataclass(frozen=True, eq=False)
class HealthyManoeuvre:
    """A manoeuvre with its healthy cycles.

    Attributes
    ----------
    command
        Command (rows,) [rad or m].
    interval_s
        Sampling interval [s].
    segments
        Segments of its strokes.
    scales
        Healthy rms about the mean cycle, (channels,), in the channels' units.
    drifting
        Indices of the loads at which healthy runs drift with the order in which they were given.
    loads
        Healthy cycles at each load.
    levels
        Scatter and thresholds of single cycles and of means, see `learn_levels`.
    """

    command: Array
    interval_s: float
    segments: tuple[StrokeSegment, ...]
    scales: Array
    drifting: tuple[int, ...]
    loads: tuple[HealthyAtLoad, ...]
    levels: tuple[Level, ...]

    @property
    def name(self) -> str:
        """The manoeuvre in words."""
        low, high = self.command.min(), self.command.max()
        return f"command {low:.4g} to {high:.4g} in {self.command.size * self.interval_s:.4g} s"

    def difference(self, cycle: Cycle, settings: DetectorSettings) -> str:
        """Return why `cycle` is of another manoeuvre, a clause; empty if it is of this manoeuvre."""
        return command_difference(self.command, self.interval_s, cycle, settings)

    def deviations(self, cycles: Sequence[Cycle], at: HealthyAtLoad, settings: DetectorSettings) -> Array:
        """Return the features of `cycles` less the healthy mean features at a load, (cycles, features)."""
        aligned = [cycle.aligned_to(self.command, settings.rows_tolerance).signals for cycle in cycles]
        residuals = np.stack([with_nearest(signals - at.mean) for signals in aligned])
        return features_of(residuals, self.segments, self.scales, settings) - at.centre


def command_difference(command: Array, interval_s: float, cycle: Cycle, settings: DetectorSettings) -> str:
    """Return how the command of `cycle` differs from `command` at `interval_s` [s], or an empty text."""
    if abs(cycle.interval_s / interval_s - 1) > settings.rows_tolerance:
        return f"a row every {cycle.interval_s:.4g} s, not {interval_s:.4g} s"
    if abs(cycle.command.size / command.size - 1) > settings.rows_tolerance:
        return f"{cycle.command.size} rows, not {command.size}"
    size = float(np.ptp(command)) or float(np.abs(command).max())
    difference = rms(cycle.aligned_to(command, settings.rows_tolerance).command - command) / size
    if difference > settings.command_tolerance:
        return f"its command differs by {100 * difference:.3g} % of the range"
    return ""


def learn_manoeuvre(
    cycles: Sequence[Cycle], groups: Sequence[Hashable], largest_load: float, settings: DetectorSettings
) -> HealthyManoeuvre:
    """Return the healthy manoeuvre of `cycles`, whose runs are `groups`.

    The residual of a cycle is its difference from the mean of the other runs at its load, as for a later
    cycle. From a mean that includes the cycle, the difference would be smaller.

    Raises
    ------
    RecordingError
        There are too few runs, of the manoeuvre or of one of its loads.
    """
    first = cycles[0]
    aligned = [cycle.aligned_to(first.command, settings.rows_tolerance) for cycle in cycles]
    numbers = {group: k for k, group in enumerate(dict.fromkeys(groups))}
    runs = np.array([numbers[group] for group in groups])
    profiles, at = _distinct_loads(aligned, largest_load, settings)
    _check_runs(cycles, runs, at, settings)
    signals = np.stack([cycle.signals for cycle in aligned])
    rows = _rows_of_several_runs(signals, runs, at)
    signals, command = signals[:, rows], first.command[rows]
    residuals = np.empty_like(signals)
    for run, load in np.unique(np.stack([runs, at], axis=1), axis=0):
        others = np.nanmean(signals[(at == load) & (runs != run)], axis=0)
        for k in np.flatnonzero((at == load) & (runs == run)):
            residuals[k] = with_nearest(signals[k] - others)
    sizes = np.nanmax(np.abs(signals), axis=(0, 1))
    scales = np.sqrt(np.mean(residuals**2, axis=(0, 1)))
    scales = np.maximum(scales, np.where(sizes > 0, LEAST_SCALE * sizes, 1.0))
    segments = segments_of(command, settings)
    features = features_of(residuals, segments, scales, settings)
    loads = tuple(
        HealthyAtLoad(
            load[rows],
            np.nanmean(signals[at == k], axis=0),
            features[at == k].mean(axis=0),
            any(cycle.load_recorded for cycle, number in zip(cycles, at, strict=True) if number == k),
        )
        for k, load in enumerate(profiles)
    )
    levels = learn_levels(features, runs, at, settings)
    drifting = drifting_loads(features, runs, at, levels[0].scatter, settings)
    return HealthyManoeuvre(command, first.interval_s, segments, scales, drifting, loads, levels)


def at_load(cycle: Cycle) -> str:
    """Return the load of a cycle in words, for error messages."""
    return f"at the load {cycle.load.mean():.4g}" if cycle.load_recorded else "without a recorded load"


def same_load(first: Array, second: Array, largest: float, settings: DetectorSettings) -> bool:
    """Return whether two loads (rows,) are the same; `largest` is the largest learned load.

    A difference within the noise of the load cell does not count.
    """
    difference = rms(first - second)
    if difference <= settings.load_tolerance * largest:
        return True
    noise = np.hypot(robust_noise_level(first, 2), robust_noise_level(second, 2))
    return bool(difference <= LOAD_NOISE * noise)


def _distinct_loads(
    cycles: Sequence[Cycle], largest: float, settings: DetectorSettings
) -> tuple[list[Array], Groups]:
    """Return the distinct loads, (rows,) each, and the index of each cycle's load, (cycles,)."""
    profiles: list[Array] = []
    at = []
    for cycle in cycles:
        known = [k for k, load in enumerate(profiles) if same_load(cycle.load, load, largest, settings)]
        if not known:
            profiles.append(cycle.load)
        at.append(known[0] if known else len(profiles) - 1)
    return profiles, np.array(at)


def _rows_of_several_runs(signals: Array, runs: Groups, at: Groups) -> NDArray[np.bool_]:
    """Return the mask (rows,) of the rows of `signals` (cycles, rows, channels) in two runs at each load."""
    known = ~np.isnan(signals[:, :, 0])
    rows = np.ones(signals.shape[1], dtype=bool)
    for load in np.unique(at):
        in_run = [known[(at == load) & (runs == run)].any(axis=0) for run in np.unique(runs[at == load])]
        rows &= np.sum(in_run, axis=0) >= 2
    return rows


def _check_runs(cycles: Sequence[Cycle], runs: Groups, at: Groups, settings: DetectorSettings) -> None:
    number = np.unique(runs).size
    if number < settings.fewest_runs:
        raise RecordingError(
            f"{cycles[0].source}: {number} healthy runs of this manoeuvre, at least {settings.fewest_runs} "
            "are needed for a threshold; record more, each on its own (cycles of one run resemble each other)"
        )
    for load in np.unique(at):
        number = np.unique(runs[at == load]).size
        if number < settings.fewest_runs_of_load:
            cycle = cycles[int(np.flatnonzero(at == load)[0])]
            raise RecordingError(
                f"{cycle.source}: {number} healthy runs {at_load(cycle)}, at least "
                f"{settings.fewest_runs_of_load} are needed for a mean cycle; record more there, or leave "
                "this load out"
            )
