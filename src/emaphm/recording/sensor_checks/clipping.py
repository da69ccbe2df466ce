"""Detection of a signal that is clipped at the end of its sensor's range."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.recording.sensor_checks.hardware_limits import is_hardware_limit
from emaphm.recording.sensor_checks.resolution import Mask, row_noise, runs_of_equal, step_of_counts


@dataclass(frozen=True)
class ClippingSettings:
    """Thresholds from which plateaus at the largest or smallest value count as clipped.

    There are at least `least_rows` clipped rows in at least `least_plateaus` plateaus, and the command moves
    in the first half of each plateau: an actuator at rest, after it followed a command, is excluded.

    If the noise of a signal exceeds `noise_counts` counts, equal values follow each other only by chance, and
    the largest value the least often. Such a signal is clipped if it returns to its largest value at least
    `least_rows` times, and `least_excess` times as often as to each count within the noise below it. This
    rule is not applied to a drive that switches in a cycle, where the `cycle` most frequent values, to `same`
    of the noise, make up more than `most_in_cycle` of all rows.

    A smooth signal is clipped if the slopes on either side of a plateau, over `slope_rows` or a quarter of
    the plateau, extrapolate `excess` counts beyond it: a smooth maximum in coarse counts also has a plateau,
    but extrapolates by less than a count. A limit of the hardware is not the end of a sensor's range.
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
    """Return whether each row of `values` (n,) of a channel is clipped while `command` (n,) moves."""
    clipped = np.zeros(values.size, bool)
    count, noise = step_of_counts(values), row_noise(values)
    noisy = noise > CLIPPING.noise_counts * count
    first, lengths = runs_of_equal(values)
    for level, sign in ((values.max(), 1.0), (values.min(), -1.0)):
        if level == 0 or count == 0 or is_hardware_limit(level, channel, actuator):
            continue
        if noisy and _piles_up(sign * values, first, count, noise):
            clipped |= values == level
            continue
        rows, plateaus = np.zeros(values.size, bool), 0
        at_level = (values[first] == level) & (lengths >= 2)
        for start, length in zip(first[at_level], lengths[at_level], strict=True):
            end = start + length
            if np.ptp(command[start : start + max(2, length // 2)]) > 0:
                cut = noisy or _is_cut(sign * values, start, end, CLIPPING.excess * max(count, noise))
                rows[start:end], plateaus = cut, plateaus + cut
        if rows.sum() >= CLIPPING.least_rows and plateaus >= CLIPPING.least_plateaus:
            # All rows at this level, including plateaus that the signal reaches with a small slope.
            clipped |= values == level
    ends = values.max(), values.min()
    if clipped.any() and ends[0] == -ends[1]:
        # A sensor's range is symmetric: a signal clipped at one end is also clipped at the other.
        clipped |= np.abs(values) == ends[0]
    return clipped


def _piles_up(values: Array, first: NDArray[np.intp], count: float, noise: float) -> bool:
    """Return whether `values` (n,), whose runs of equal values begin at `first`, pile up at the largest.

    A signal that rests at its largest value reaches it once or twice only. A signal that switches in a cycle
    has few distinct values and returns to the others as often.
    """
    level = values.max()
    visits = int(np.count_nonzero(values[first] == level))
    if visits < CLIPPING.least_rows:
        return False
    within_noise = float(np.count_nonzero((values < level) & (values >= level - noise))) * count / noise
    frequencies = np.unique(np.round(values / max(count, CLIPPING.same * noise)), return_counts=True)[1]
    in_cycle = np.sort(frequencies)[-CLIPPING.cycle :].sum() > CLIPPING.most_in_cycle * values.size
    return not in_cycle and visits >= CLIPPING.least_excess * within_noise


def _is_cut(values: Array, start: int, end: int, least: float) -> bool:
    """Return whether the slopes before row `start` and after `end` extrapolate `least` beyond the plateau.

    A parabola with slopes m and -m at the ends of a plateau of n rows is m n / 4 higher in the middle.
    """
    width = max(CLIPPING.slope_rows, (end - start) // 4)
    if start < 2 * width or end + 2 * width > values.size:
        return False
    up, up_before = _slope(values[start - width : start]), _slope(values[start - 2 * width : start - width])
    down, down_after = -_slope(values[end : end + width]), -_slope(values[end + width : end + 2 * width])
    # The slope of a signal that settles decreases; such a signal is not clipped.
    steady = up > 0.3 * up_before and down > 0.3 * down_after
    return steady and min(up, down) > 0 and min(up, down) * (end - start) / 4 > least


def _slope(values: Array) -> float:
    """Return the slope of the least-squares line through `values` (n,) [per row]."""
    rows = np.arange(values.size) - (values.size - 1) / 2
    return float(rows @ values / (rows @ rows))
