"""Detection of held samples: lost samples that the recording replaces by the value of the row before."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.recording.sensor_checks.resolution import Mask, row_noise, runs_of_equal, step_of_repeats


@dataclass(frozen=True)
class HeldSettings:
    """Thresholds from which repeated values count as held.

    In a smooth signal, held rows are a run of equal values around which, on either side, the signal moves by
    more than `moves` times its noise and `counts` counts per row: noise alone then repeats a value once in
    10⁷ rows. At least `least_rows` rows are held, since fewer may be chance, and they are at least
    `least_share` of the rows in which they could be detected. A run has at most `longest_run` rows; longer
    runs are frozen. A value that also occurs in another run, of `rest` rows or more, is a value at which the
    signal rests.

    In a signal with noise or ripple of `fine` counts or more, held rows are single repeats between rows that
    are at least `counts` counts away. (In a signal that moves by about a count per row, rounding makes steps
    of 2, 0, 2 counts more likely than 2, 1, 2.) By chance, a difference of 0 is hardly more likely than a
    difference of 1 or 2 counts. If it is `least_excess` times as frequent as these, and as any other
    difference, to `same` of the noise, most repeats are held rows; for a drive that switches in a cycle,
    other differences repeat as often. There are at least `least_repeats` repeats, and `least_repeated` of all
    rows. A value that occurs again within `near` rows is not counted: a drive whose cycle is synchronous with
    the rows, for a part of a recording, has the same few values, while the value of a lost sample does not
    return. Nor are repeats at smooth reversals counted: there, backlash or dry friction may hold an exact
    position for a row.
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
    """Return whether each row of `values` (n,) is held, a repeat of the row before it, if that is detectable.

    Held rows are not detected where the signal hardly moves: there a held sample has hardly an error.
    """
    if values.size < 8:
        return np.zeros(values.size, bool)
    return _held_in_motion(values) | _held_in_noise(values)


def _held_in_motion(values: Array) -> Mask:
    """Return the held rows (n,) of a smooth signal: each run is followed by a jump by the missed motion."""
    none_held = np.zeros(values.size, bool)
    # Differences are whole counts except for rounding.
    least = max(HELD.moves * row_noise(values), (HELD.counts - 0.01) * step_of_repeats(values))
    steps = np.diff(values)
    held = none_held.copy()
    first, lengths = runs_of_equal(values)
    rests = _rest_values(values[first], lengths)
    for start, length, rest in zip(first, lengths, rests, strict=True):
        end = start + length
        if rest or not 2 <= length <= HELD.longest_run or start < 2 or end + 1 >= values.size:
            continue
        before, jump, after = values[start] - values[start - 1], steps[end - 1], steps[end]
        # Mean step before and after the run; the jump at its end covers the motion during the held rows.
        usual = (before + after) / 2
        missed = length * usual
        same_way = min(abs(before), abs(after)) > least and before * after > 0
        if same_way and abs(jump - missed) < abs(jump - usual):
            held[start + 1 : end] = True
    detectable = int(np.count_nonzero(np.abs(steps) > least))
    too_few = held.sum() < HELD.least_rows or held.sum() < HELD.least_share * detectable
    return none_held if too_few else held


def _rest_values(values: Array, lengths: NDArray[np.intp]) -> Mask:
    """Return whether each of the runs of equal `values` (k,) has the same value as another, long run."""
    long = lengths >= HELD.rest
    _, place = np.unique(values, return_inverse=True)
    return np.asarray(np.bincount(place, weights=long)[place] > long)


def _held_in_noise(values: Array) -> Mask:
    """Return the held rows (n,) of a signal with fine counts: repeats far more frequent than by chance."""
    held = np.zeros(values.size, bool)
    count, noise = step_of_repeats(values), row_noise(values)
    if noise < HELD.fine * count:
        return held
    steps = np.diff(values)
    least = (HELD.counts - 0.5) * count
    between = (np.abs(steps[:-2]) > least) & (np.abs(steps[2:]) > least)
    is_unique = ~_occurs_again(values, max(count, HELD.same * noise) / 2)
    repeated = between & (steps[1:-1] == 0) & is_unique[1:-2] & is_unique[2:-1]
    repeats = int(np.count_nonzero(repeated & ~_within_smooth_reversal(steps)[1:-1]))
    if repeats < max(HELD.least_repeats, HELD.least_repeated * values.size):
        return held
    nonzero = steps[1:-1][between & (steps[1:-1] != 0)]
    near = np.count_nonzero(np.abs(nonzero) < (HELD.counts + 0.5) * count) / (2 * HELD.counts)
    frequencies = np.unique(np.round(nonzero / max(count, HELD.same * noise)), return_counts=True)[1]
    if repeats >= HELD.least_excess * max(near, int(frequencies.max(initial=0))):
        held[2:-1] = repeated
    return held


def _within_smooth_reversal(steps: Array) -> Mask:
    """Return whether the five steps about each of `steps` (n,) rise or fall throughout, and change sign."""
    reversals = np.zeros(steps.size, bool)
    rising = np.diff(steps) > 0
    falling = np.diff(steps) < 0
    for one_way in (rising, falling):
        throughout = one_way[:-3] & one_way[1:-2] & one_way[2:-1] & one_way[3:]
        reversals[2:-2] |= throughout & (steps[1:-3] * steps[3:-1] < 0)
    return reversals


def _occurs_again(values: Array, tolerance: float) -> Mask:
    """Return whether each of `values` (n,) occurs again, to `tolerance`, 2 to `HELD.near` rows away."""
    again = np.zeros(values.size, bool)
    for lag in range(2, HELD.near + 1):
        same = np.abs(values[lag:] - values[:-lag]) <= tolerance
        again[lag:] |= same
        again[:-lag] |= same
    return again


def interpolated(values: Array, held: Mask) -> Array:
    """Return `values` (n,) with the `held` rows (n,) interpolated linearly from the rows on either side."""
    rows = np.arange(values.size)
    return np.interp(rows, rows[~held], values[~held])
