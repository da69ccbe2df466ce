"""Samples that were lost and stand in the recording with the value of the row before."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.recording.sensor_checks.resolution import Mask, row_noise, runs_of_equal, step_of_counts


@dataclass(frozen=True)
class HeldSettings:
    """Which repeated values count as held.

    In a smooth signal: a run of equal values where the signal, by the rows on either side, goes on by more
    than `moves` times its noise, and `counts` counts, in each row: noise alone then repeats a value once in
    10⁷ rows. Between `least_rows` of them and `longest_run` rows each: fewer may be chance, longer ones are
    frozen. At least `least_share` of the rows that could show it are held. A value that also stands in
    another run, of `rest` rows or more, is one at which the signal rests.

    In a signal that is noise or ripple of `fine` counts or more (of one that moves by about a count a row,
    rounding makes steps of 2, 0, 2 counts likelier than 2, 1, 2): single repeats between rows that are
    `counts` counts away at least. A difference of 0 is then hardly likelier than one of 1 or 2 counts;
    where it is `least_excess` times as frequent, and as any other difference, to `same` of the noise, most
    repeats are held rows: of a drive that switches in a cycle, the same differences return too. They are
    `least_repeats` and `least_repeated` of all rows at least. A value that stands again within `near` rows
    is not counted: a drive whose cycle keeps step with the rows, for a part of a recording, takes the same
    few values, while that of a lost sample is gone with it.
    """

    moves: float = 5.0
    counts: int = 2
    least_rows: int = 3
    longest_run: int = 20
    least_share: float = 2e-3
    rest: int = 5
    fine: float = 2.0
    least_excess: float = 4.0
    same: float = 1e-3
    least_repeats: int = 8
    least_repeated: float = 3e-3
    near: int = 8


HELD = HeldSettings()


def held_rows(values: Array) -> Mask:
    """Return whether each row of `values` (n,) only repeats the one before it, where that can be seen.

    Rows where the signal moves no more than a repeat by chance are not found: there a held sample does no
    harm.
    """
    if values.size < 8:
        return np.zeros(values.size, bool)
    return _in_motion(values) | _in_noise(values)


def _in_motion(values: Array) -> Mask:
    """Return the held rows of a smooth signal: each is followed by a jump of all that was missed."""
    nothing = np.zeros(values.size, bool)
    # Differences of exact counts, but for rounding.
    least = max(HELD.moves * row_noise(values), (HELD.counts - 0.01) * step_of_counts(values))
    steps = np.diff(values)
    held = nothing.copy()
    first, lengths = runs_of_equal(values)
    rests = _rests(values[first], lengths)
    for start, length, rest in zip(first, lengths, rests, strict=True):
        end = start + length
        if rest or not 2 <= length <= HELD.longest_run or start < 2 or end + 1 >= values.size:
            continue
        before, jump, after = values[start] - values[start - 1], steps[end - 1], steps[end]
        # What the row before and the row after move by; the jump makes up for the rows held.
        usual = (before + after) / 2
        missed = length * usual
        same_way = min(abs(before), abs(after)) > least and before * after > 0
        if same_way and abs(jump - missed) < abs(jump - usual):
            held[start + 1 : end] = True
    could = int(np.count_nonzero(np.abs(steps) > least))
    few = held.sum() < HELD.least_rows or held.sum() < HELD.least_share * could
    return nothing if few else held


def _rests(values: Array, lengths: NDArray[np.intp]) -> Mask:
    """Return of runs of equal `values` (k,) whether another one, of many rows, has the same value."""
    many = lengths >= HELD.rest
    _, place = np.unique(values, return_inverse=True)
    return np.asarray(np.bincount(place, weights=many)[place] > many)


def _in_noise(values: Array) -> Mask:
    """Return the held rows of a signal of fine counts: repeats that are far more frequent than by chance."""
    held = np.zeros(values.size, bool)
    count, noise = step_of_counts(values), row_noise(values)
    if noise < HELD.fine * count:
        return held
    steps = np.diff(values)
    least = (HELD.counts - 0.5) * count
    between = (np.abs(steps[:-2]) > least) & (np.abs(steps[2:]) > least)
    alone = ~_stands_again(values, max(count, HELD.same * noise) / 2)
    repeated = between & (steps[1:-1] == 0) & alone[1:-2] & alone[2:-1]
    repeats = int(np.count_nonzero(repeated))
    if repeats < max(HELD.least_repeats, HELD.least_repeated * values.size):
        return held
    others = steps[1:-1][between & (steps[1:-1] != 0)]
    near = np.count_nonzero(np.abs(others) < (HELD.counts + 0.5) * count) / (2 * HELD.counts)
    alike = np.unique(np.round(others / max(count, HELD.same * noise)), return_counts=True)[1]
    if repeats >= HELD.least_excess * max(near, int(alike.max(initial=0))):
        held[2:-1] = repeated
    return held


def _stands_again(values: Array, tolerance: float) -> Mask:
    """Return whether each of `values` (n,) stands in a near row again, but for `tolerance`: not the next."""
    again = np.zeros(values.size, bool)
    for lag in range(2, HELD.near + 1):
        same = np.abs(values[lag:] - values[:-lag]) <= tolerance
        again[lag:] |= same
        again[:-lag] |= same
    return again


def interpolated(values: Array, held: Mask) -> Array:
    """Return `values` (n,) with those that were `held` (n,) put on a line between the rows on either side."""
    rows = np.arange(values.size)
    return np.interp(rows, rows[~held], values[~held])
