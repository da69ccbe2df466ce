"""A signal that is cut off at the end of its sensor's range."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.recording.sensor_checks.hardware_limits import is_hardware_limit
from emaphm.recording.sensor_checks.resolution import Mask, row_noise, runs_of_equal, step_of_counts


@dataclass(frozen=True)
class ClippingSettings:
    """Which plateaus at the largest or smallest value count as clipped.

    `least_rows` in `least_plateaus` at least, in each of which the command moves in the first half: an
    actuator that has answered a command rests until that jumps. Of a signal whose noise exceeds
    `noise_counts` counts, no value comes twice in a row but by chance, the largest least of all; nor does it
    come back to its largest value `least_rows` times, `least_excess` times as often as to each count within
    the noise below. That is not asked of a drive that switches in a cycle, where `cycle` values, to `same` of
    the noise, are more than `most_in_cycle` of all. Of a smooth signal, the slopes on either side of a
    plateau, over `slope_rows` or a quarter of it, would lead it `excess` counts farther: a smooth maximum in
    coarse counts is a plateau too, but of less than a count. A limit of the hardware is no end of the range.
    """

    least_rows: int = 8
    least_plateaus: int = 2
    noise_counts: float = 1.5
    least_excess: float = 4.0
    cycle: int = 20
    most_in_cycle: float = 0.5
    same: float = 1e-3
    slope_rows: int = 4
    excess: float = 3.0


CLIPPING = ClippingSettings()


def clipped_rows(values: Array, channel: str, command: Array, actuator: Actuator) -> Mask:
    """Return whether each row of `values` (n,) of a channel is cut off, while `command` (n,) moves on."""
    clipped = np.zeros(values.size, bool)
    count, noise = step_of_counts(values), row_noise(values)
    noisy = noise > CLIPPING.noise_counts * count
    first, lengths = runs_of_equal(values)
    for level, sign in ((values.max(), 1.0), (values.min(), -1.0)):
        if level == 0 or count == 0 or is_hardware_limit(level, channel, actuator):
            continue
        if noisy and _returns(sign * values, first, count, noise):
            clipped |= values == level
            continue
        rows, plateaus = np.zeros(values.size, bool), 0
        at_level = (values[first] == level) & (lengths >= 2)
        for start, length in zip(first[at_level], lengths[at_level], strict=True):
            end = start + length
            if np.ptp(command[start : start + max(2, length // 2)]) > 0:
                cut = noisy or _cut(sign * values, start, end, CLIPPING.excess * max(count, noise))
                rows[start:end], plateaus = cut, plateaus + cut
        if rows.sum() >= CLIPPING.least_rows and plateaus >= CLIPPING.least_plateaus:
            # What stops there gently may be cut off as well.
            clipped |= values == level
    ends = values.max(), values.min()
    if clipped.any() and ends[0] == -ends[1]:
        # A sensor's range is symmetric: what was cut at one end was at the other too.
        clipped |= np.abs(values) == ends[0]
    return clipped


def _returns(values: Array, first: NDArray[np.intp], count: float, noise: float) -> bool:
    """Return whether `values` (n,), of which runs of equal ones begin at `first`, pile up at the largest.

    One that rests at its largest value comes there once or twice, however long it stays. One that switches in
    a cycle has few values, and comes back to others as often.
    """
    level = values.max()
    visits = int(np.count_nonzero(values[first] == level))
    if visits < CLIPPING.least_rows:
        return False
    within_noise = float(np.count_nonzero((values < level) & (values >= level - noise))) * count / noise
    alike = np.unique(np.round(values / max(count, CLIPPING.same * noise)), return_counts=True)[1]
    in_cycle = np.sort(alike)[-CLIPPING.cycle :].sum() > CLIPPING.most_in_cycle * values.size
    return not in_cycle and visits >= CLIPPING.least_excess * within_noise


def _cut(values: Array, start: int, end: int, least: float) -> bool:
    """Return whether the slopes before row `start` and after row `end` lead beyond the plateau by `least`.

    A parabola with slope m at both ends of a plateau of n rows is m n / 4 higher in the middle.
    """
    width = max(CLIPPING.slope_rows, (end - start) // 4)
    if start < 2 * width or end + 2 * width > values.size:
        return False
    up, up_before = _slope(values[start - width : start]), _slope(values[start - 2 * width : start - width])
    down, down_after = -_slope(values[end : end + width]), -_slope(values[end + width : end + 2 * width])
    # What settles gently is not cut: its slope fades.
    steady = up > 0.3 * up_before and down > 0.3 * down_after
    return steady and min(up, down) > 0 and min(up, down) * (end - start) / 4 > least


def _slope(values: Array) -> float:
    """Return the slope of a line through `values` (n,) [per row]."""
    rows = np.arange(values.size) - (values.size - 1) / 2
    return float(rows @ values / (rows @ rows))
