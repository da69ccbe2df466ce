"""Detection of a sensor that keeps its value for a long time although its quantity changes."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.recording.sensor_checks.hardware_limits import is_hardware_limit
from emaphm.recording.sensor_checks.resolution import Mask, row_noise, runs_of_equal, step_of_counts


@dataclass(frozen=True)
class FreezingSettings:
    """Thresholds from which runs of equal values count as frozen.

    A run has at least `least_rows` rows, and until `answer` rows before its end the command moves by
    `least_share` of its range: all signals of a resting actuator rest until it responds to a jump of the
    command.

    A signal whose noise exceeds `noise_counts` counts cannot repeat a value by chance for that time. There
    are three exceptions. It has settled: its last `around` steps are within `settled` of the noise, as can be
    in exact numbers. It came to rest and left slowly, as a shaft that friction holds at each reversal: its
    noise and its last step are within `slow` of the usual step, and the run does not end with a jump. It is a
    speed from counted encoder marks: none of the `least_rows` steps on either side exceeds a count, whereas
    one in six would with noise of that size.

    Without noise, the end of the run decides: a frozen signal jumps by `jump` times the largest of its usual
    step, its count and the `around` steps that follow. A jammed actuator, or one at an end stop, starts from
    rest, and a drive leaves its limit slowly. At least `least_live` moving rows are needed to determine the
    usual step.
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
    """Return whether each row of `values` (n,) of a channel is frozen while `command` (n,) moves."""
    frozen = np.zeros(values.size, bool)
    first, lengths = runs_of_equal(values)
    long = lengths >= FREEZING.least_rows
    live = ~np.repeat(long, lengths)
    if not long.any() or np.count_nonzero(live) < FREEZING.least_live:
        return frozen
    signal = _MovingSignal.of(values, live)
    moved = FREEZING.least_share * float(np.ptp(command))
    for start, length in zip(first[long], lengths[long], strict=True):
        end, level = start + length, float(values[start])
        # A signal at zero is at rest, or its drive is off.
        rests = level == 0 or is_hardware_limit(level, channel, actuator)
        swing = float(np.ptp(command[start : end - FREEZING.answer]))
        if rests or swing == 0 or swing < moved:
            continue
        if signal.cannot_stay(values, start, end) or signal.cannot_leave(values[end - 1 :]):
            frozen[start + 1 : end] = True
    return frozen


@dataclass(frozen=True)
class _MovingSignal:
    """Properties of a signal where it moves: its noise, converter count, and usual step from row to row."""

    noise: float
    count: float
    step: float

    @classmethod
    def of(cls, values: Array, live: Mask) -> Self:
        """Return the noise, count and usual step of `values` (n,), from the rows that are `live` (n,).

        The noise is estimated from the longest live stretch.
        """
        first, lengths = runs_of_equal(live.astype(float))
        length, start = max((n, at) for n, at in zip(lengths, first, strict=True) if live[at])
        step = float(np.percentile(np.abs(np.diff(values))[live[1:]], 90))
        return cls(row_noise(values[start : start + length]), step_of_counts(values), step)

    def cannot_stay(self, values: Array, start: int, end: int) -> bool:
        """Return whether the noise excludes that `values` (n,) stay constant from row `start` to `end`."""
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
        """Return whether `values` (n,) leave the first value by a jump and continue with usual steps."""
        steps = np.abs(np.diff(values[: FREEZING.around + 2]))
        usual = max(self.step, self.count, np.max(steps[1:], initial=0.0))
        return bool(steps.size and steps[0] > FREEZING.jump * usual)
