"""Gaps from empty cells and lost rows: short gaps are interpolated, long gaps are left to the checks."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array, runs
from emaphm.errors import RecordingError
from emaphm.recording.checks import GAP
from emaphm.recording.conditioning.interpolation import HELD, continuous, curve
from emaphm.recording.schema import SCHEMA
from emaphm.text_table import counted

Columns = dict[str, Array]

FEWEST_ROWS = 3
"""Least number of rows for a curve."""


def in_long_gaps(channels: Mapping[str, Array], longest: int) -> NDArray[np.bool_]:
    """Return whether each row (n,) lies in a gap of any channel that is longer than `longest` rows."""
    inside = np.zeros(channels["time_s"].size, bool)
    for values in channels.values():
        for start, stop in runs(np.isnan(values)):
            if stop - start > longest:
                inside[start:stop] = True
    return inside


def _short_gaps(values: Array, longest: int) -> list[tuple[int, int]]:
    """Return start and stop of the runs of at most `longest` empty cells in a column (n,)."""
    return [(start, stop) for start, stop in runs(np.isnan(values)) if stop - start <= longest]


def with_zeros_in_short_gaps(channels: Mapping[str, Array], longest: int) -> Columns:
    """Return `channels` with 0 in the empty cells of the measured channels in gaps of at most `longest` rows.

    A value that is not finite then lies in a long gap, or was recorded so.
    """
    columns = dict(channels)
    for name in _measured_channels(columns):
        if short := _short_gaps(columns[name], longest):
            columns[name] = columns[name].copy()
        for start, stop in short:
            columns[name][start:stop] = 0.0
    return columns


def interval_of(time: Array) -> float:
    """Return the median of the positive steps of `time` (n,) [s], NaN if there is none."""
    steps = np.diff(time)
    steps = steps[steps > 0]
    return float(np.median(steps)) if steps.size else float("nan")


def with_lost_rows(channels: Columns, longest: int) -> tuple[Columns, tuple[str, ...]]:
    """Return channels with interpolated rows where at most `longest` successive rows were lost, and a note.

    Rows are lost where a time step is a multiple of the usual step, to a quarter of it. Columns beyond the
    schema are left empty there, except constant columns, which are labels.
    """
    time = channels["time_s"]
    interval = interval_of(time)
    if not np.all(np.isfinite(time)) or not _increases(time) or time.size < FEWEST_ROWS:
        return channels, ()
    with np.errstate(over="ignore", invalid="ignore"):
        relative = np.diff(time) / interval
    places = np.flatnonzero((relative >= GAP) & (relative <= longest + 1.25))
    lost = np.round(relative[places]).astype(int) - 1
    if not places.size or np.any(np.abs(relative[places] - lost - 1) > 0.25):
        return channels, ()
    before = np.repeat(places + 1, lost)
    share = np.concatenate([np.arange(1, n + 1) / (n + 1) for n in lost])
    times = time[before - 1] + share * (time[before] - time[before - 1])
    at = before + np.arange(before.size)
    filled = {name: np.insert(values, before, _in_lost_rows(values)) for name, values in channels.items()}
    filled["time_s"] = np.insert(time, before, times)
    for name in filled.keys() & SCHEMA.keys() - {"time_s"}:
        filled[name] = _interpolated(name, filled["time_s"], filled[name], at)
    note = (
        f"{counted(int(lost.sum()), 'row')} lost in {counted(places.size, 'place')}, the first after "
        f"{time[places[0]]:.6g} s, interpolated"
    )
    return filled, (note,)


def _in_lost_rows(values: Array) -> float:
    """Return the value for lost rows of a column (n,): its value if it is constant, else NaN."""
    return float(values[0]) if np.all(values == values[0]) else float("nan")


def without_short_gaps(channels: Columns, longest: int) -> tuple[Columns, tuple[str, ...]]:
    """Return channels whose gaps of at most `longest` rows are interpolated, with a note for each channel.

    Rows of a short gap at either end of the recording are left out: there is no value on one side of them.
    Time and columns beyond the schema are not changed.
    """
    channels, notes = _without_open_ends(channels, longest)
    time = channels["time_s"]
    filled = dict(channels)
    for name in _measured_channels(channels):
        gaps = _short_gaps(channels[name], longest)
        if not gaps or not _increases(time):
            continue
        at = np.concatenate([np.arange(a, b) for a, b in gaps])
        filled[name] = _interpolated(name, time, channels[name], at)
        note = f"{name}: {counted(at.size, 'empty cell')} in {counted(len(gaps), 'gap')}, the first at "
        note += f"{time[at[0]]:.6g} s, {'held' if name in HELD else 'interpolated'}"
        notes += (note,)
    return filled, notes


def _interpolated(name: str, time: Array, values: Array, at: NDArray[np.intp]) -> Array:
    """Return `values` (n,) with the rows `at` interpolated from the other rows, or held."""
    known = np.flatnonzero(np.isfinite(values))
    # The whole angle is unwrapped: later steps would not detect the turns of an angle that is unwrapped in
    # part.
    filled = continuous(values).copy() if name == "angle_rad" else values.copy()
    if known.size < FEWEST_ROWS:
        return filled
    if name in HELD:
        filled[at] = values[known[np.maximum(np.searchsorted(known, at) - 1, 0)]]
    else:
        filled[at] = curve(time[known], filled[known], time[at])
    return filled


def _measured_channels(channels: Columns) -> list[str]:
    return [name for name in channels if name in SCHEMA and name != "time_s"]


def _without_open_ends(channels: Columns, longest: int) -> tuple[Columns, tuple[str, ...]]:
    rows = channels["time_s"].size
    first, last = 0, rows
    names = []
    gaps = [
        (start, stop, name)
        for name in _measured_channels(channels)
        for start, stop in _short_gaps(channels[name], longest)
    ]
    # Rows that one channel leaves out may uncover a gap of another channel: its other side is left out too.
    for start, stop, name in sorted(gaps):
        if start <= first < stop:
            first = stop
            names.append(name)
    for start, stop, name in sorted(gaps, key=lambda gap: -gap[1]):
        if start < last <= stop:
            last = start
            names.append(name)
    if not names:
        return channels, ()
    note = f"{_ends(first, last, rows)} left out, where {', '.join(dict.fromkeys(names))} is empty"
    return {name: values[first:last] for name, values in channels.items()}, (note,)


def covered_rows(columns: Mapping[str, Array], rows: int, source: str) -> tuple[slice, tuple[str, ...]]:
    """Return the rows from the first to the last row in which all columns (rows,) have a value, and a note.

    Parameters
    ----------
    columns
        Columns interpolated from their own times, by name in the file; NaN at times that they do not cover.
    rows
        Number of rows.
    source
        The file's name, for errors.

    Raises
    ------
    RecordingError
        There is no such row: the times do not overlap.
    """
    first, last = 0, rows
    names = []
    for name, values in columns.items():
        known = np.flatnonzero(np.isfinite(values))
        start, stop = (int(known[0]), int(known[-1]) + 1) if known.size else (rows, 0)
        first, last = max(first, start), min(last, stop)
        names += [name] if start > 0 or stop < rows else []
    if not names:
        return slice(0, rows), ()
    if first >= last:
        raise RecordingError(
            f"{source}: the times of {', '.join(names)} do not overlap with those of the command; export all "
            "columns on the same clock"
        )
    note = f"{_ends(first, last, rows)} left out, which the times of {', '.join(names)} do not cover"
    return slice(first, last), (note,)


def _ends(first: int, last: int, rows: int) -> str:
    """Return the words for the rows before `first` and from `last` on."""
    ends = [f"the first {counted(first, 'row')}"] if first else []
    ends += [f"the last {counted(rows - last, 'row')}"] if last < rows else []
    return " and ".join(ends)


def _increases(time: Array) -> bool:
    return bool(np.all(np.diff(time) > 0))
