"""A sensor that keeps its value for a long time while what it measures goes on."""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.recording.sensor_checks.resolution import Mask, row_noise, runs_of_equal, step_of_counts


@dataclass(frozen=True)
class FreezingSettings:
    """Which runs of equal values count as frozen.

    `least_rows` at least, and `least_share` of the command's range commanded meanwhile, `answer` rows before
    the run ends at least: of a resting actuator all signals rest until a command that jumps is answered. A
    signal whose noise exceeds `noise_counts` counts cannot repeat a value by chance for so long. Without
    noise, what ends the run decides: a jump of `jump` times the usual step of a row and its counts. An
    actuator that is jammed or stands at an end stop starts from rest.
    """

    least_rows: int = 25
    least_share: float = 0.1
    answer: int = 5
    noise_counts: float = 0.7
    jump: float = 5.0


FREEZING = FreezingSettings()


def frozen_rows(values: Array, command: Array) -> Mask:
    """Return whether each row of `values` (n,) is frozen, while `command` (n,) moves on."""
    frozen = np.zeros(values.size, bool)
    first, lengths = runs_of_equal(values)
    long = lengths >= FREEZING.least_rows
    if not long.any() or long.sum() == lengths.size == 1:
        return frozen
    in_run = np.repeat(long, lengths)
    live = np.flatnonzero(~in_run)
    if live.size < FREEZING.least_rows:
        return frozen
    count = step_of_counts(values)
    noisy = _noise_of(values, in_run) > FREEZING.noise_counts * count
    usual = float(np.percentile(np.abs(np.diff(values))[~in_run[1:]], 90)) if live.size > 1 else 0.0
    least_jump = FREEZING.jump * max(usual, count)
    moved = FREEZING.least_share * float(np.ptp(command))
    for start, length in zip(first[long], lengths[long], strict=True):
        end = start + length
        if np.ptp(command[start : end - FREEZING.answer]) < moved or values[start] == 0:
            # A signal at zero rests, or its drive is off.
            continue
        jumps = end < values.size and abs(values[end] - values[end - 1]) > least_jump
        if noisy or jumps:
            frozen[start + 1 : end] = True
    return frozen


def _noise_of(values: Array, excluded: Mask) -> float:
    """Return the row noise of `values` (n,) in their longest stretch that is not `excluded` (n,)."""
    first, lengths = runs_of_equal(excluded.astype(float))
    kept = [(length, start) for start, length in zip(first, lengths, strict=True) if not excluded[start]]
    length, start = max(kept)
    return row_noise(values[start : start + length])
