"""A sensor that keeps its value for a long time while what it measures goes on."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.recording.sensor_checks.hardware_limits import is_hardware_limit
from emaphm.recording.sensor_checks.resolution import Mask, row_noise, runs_of_equal, step_of_counts


@dataclass(frozen=True)
class FreezingSettings:
    """Which runs of equal values count as frozen.

    `least_rows` at least, and `least_share` of the command's range commanded meanwhile, `answer` rows before
    the run ends at least: of a resting actuator all signals rest until a command that jumps is answered. A
    signal whose noise exceeds `noise_counts` counts cannot repeat a value by chance for so long, unless it
    has settled: its last `around` steps are within `settled` of the noise, as those of exact numbers can be.
    Or unless it came to rest and left again, as a shaft that friction holds at each turn: where its noise is
    within `slow` of the usual step, so is its last step, and the run does not end by a jump.
    Nor does that hold of a speed that counts an encoder's marks: of the `least_rows` steps on either side
    none exceeds a count, where noise of that size has one in six that do.
    Without noise, what ends the run decides: a jump of `jump` times the usual step of a row, its counts and
    the `around` steps that follow. An actuator that is jammed or stands at an end stop starts from rest, as
    a drive leaves a limit. `least_live` rows that move are needed, to know what is usual.
    """

    least_rows: int = 25
    least_live: int = 12
    around: int = 4
    settled: float = 0.1
    slow: float = 0.1
    least_share: float = 0.1
    answer: int = 5
    noise_counts: float = 0.7
    jump: float = 5.0


FREEZING = FreezingSettings()


def frozen_rows(values: Array, channel: str, command: Array, actuator: Actuator) -> Mask:
    """Return whether each row of `values` (n,) of a channel is frozen, while `command` (n,) moves on."""
    frozen = np.zeros(values.size, bool)
    first, lengths = runs_of_equal(values)
    long = lengths >= FREEZING.least_rows
    live = ~np.repeat(long, lengths)
    if not long.any() or np.count_nonzero(live) < FREEZING.least_live:
        return frozen
    usual = _Usual.of(values, live)
    moved = FREEZING.least_share * float(np.ptp(command))
    for start, length in zip(first[long], lengths[long], strict=True):
        end, level = start + length, float(values[start])
        # A signal at zero rests, or its drive is off.
        rests = level == 0 or is_hardware_limit(level, channel, actuator)
        swing = float(np.ptp(command[start : end - FREEZING.answer]))
        if rests or swing == 0 or swing < moved:
            continue
        if usual.cannot_stay(values, start, end) or usual.cannot_leave(values[end - 1 :]):
            frozen[start + 1 : end] = True
    return frozen


@dataclass(frozen=True)
class _Usual:
    """What is usual of a signal where it moves: its noise, count, and step from row to row."""

    noise: float
    count: float
    step: float

    @classmethod
    def of(cls, values: Array, live: Mask) -> Self:
        """Return the usual noise, count and step of `values` (n,), from the rows where they are `live` (n,).

        The noise is that of the longest live stretch.
        """
        first, lengths = runs_of_equal(live.astype(float))
        length, start = max((n, at) for n, at in zip(lengths, first, strict=True) if live[at])
        step = float(np.percentile(np.abs(np.diff(values))[live[1:]], 90))
        return cls(row_noise(values[start : start + length]), step_of_counts(values), step)

    def cannot_stay(self, values: Array, start: int, end: int) -> bool:
        """Return whether noise would not let `values` (n,) stay where they are from row `start` to `end`."""
        before = np.abs(np.diff(values[max(start - FREEZING.around, 0) : start + 1]))
        settled = before.size > 0 and np.max(before) < FREEZING.settled * self.noise
        return self.noise > FREEZING.noise_counts * self.count and not (
            settled or self._is_counted(values, start, end) or self._rests(values, start, end)
        )

    def _rests(self, values: Array, start: int, end: int) -> bool:
        """Return whether smooth `values` (n,) come to rest at row `start` and leave slowly at row `end`."""
        last = abs(values[start] - values[start - 1]) if start else 0.0
        slow = max(self.noise, last) < FREEZING.slow * self.step
        return bool(slow and end < values.size and not self.cannot_leave(values[end - 1 :]))

    def _is_counted(self, values: Array, start: int, end: int) -> bool:
        """Return whether `values` (n,) move by single counts around a run from row `start` to `end`."""
        rows = FREEZING.least_rows
        sides = values[max(start - rows, 0) : start + 1], values[end - 1 : end + rows]
        steps = np.abs(np.concatenate([np.diff(side) for side in sides]))
        return steps.size >= FREEZING.least_live and float(np.max(steps)) < 1.5 * self.count

    def cannot_leave(self, values: Array) -> bool:
        """Return whether `values` (n,) leave the first one by a jump, and then go on as usual."""
        steps = np.abs(np.diff(values[: FREEZING.around + 2]))
        others = max(self.step, self.count, np.max(steps[1:], initial=0.0))
        return bool(steps.size and steps[0] > FREEZING.jump * others)
