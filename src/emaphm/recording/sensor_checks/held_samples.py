"""Samples that were lost and stand in the recording with the value of the row before."""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.recording.sensor_checks.resolution import Mask, row_noise, runs_of_equal, step_of_counts


@dataclass(frozen=True)
class HeldSettings:
    """Which repeated values count as held.

    A run of equal values is held where the signal, by the rows on either side, goes on by more than `moves`
    times its noise and counts in each row: noise alone then repeats a value once in 10⁷ rows. Between
    `least_rows` of them and `longest_run` rows each: fewer may be chance, longer ones are frozen. At least
    `least_share` of the rows that could show it are held.
    """

    moves: float = 5.0
    least_rows: int = 3
    longest_run: int = 20
    least_share: float = 2e-3


HELD = HeldSettings()


def held_rows(values: Array) -> Mask:
    """Return whether each row of `values` (n,) only repeats the one before it, where that can be seen.

    A held row is followed by a jump of all that was missed. Rows where the signal hardly moves are not found:
    there a held sample does no harm.
    """
    nothing = np.zeros(values.size, bool)
    if values.size < 8:
        return nothing
    least = HELD.moves * max(row_noise(values), step_of_counts(values))
    steps = np.diff(values)
    held = nothing.copy()
    first, lengths = runs_of_equal(values)
    for start, length in zip(first, lengths, strict=True):
        end = start + length
        if not 2 <= length <= HELD.longest_run or start < 2 or end + 1 >= values.size:
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


def interpolated(values: Array, held: Mask) -> Array:
    """Return `values` (n,) with those that were `held` (n,) put on a line between the rows on either side."""
    rows = np.arange(values.size)
    return np.interp(rows, rows[~held], values[~held])
