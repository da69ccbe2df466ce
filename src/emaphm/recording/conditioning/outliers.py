"""Detection of isolated outliers and drop-outs of one or two rows, and their replacement by interpolation.

The rule is similar to Hampel's: it compares the deviation from the running median with a robust local spread.
The chopped current of a hysteresis drive, the current pulse of a start and the voltage of a switching drive
also deviate from their running median. Therefore three conditions must hold: the deviation from the median of
the neighbours is large relative to the usual deviations of the channel and to those of the neighbours; the
row is outside the channel's usual range, or exactly 0; and the command did not jump just before.

References
----------
[1] F. R. Hampel, The influence curve and its role in robust estimation, Journal of the American Statistical
Association 69 (1974).
[2] R. K. Pearson, Outliers in process modeling and identification, IEEE Transactions on Control Systems
Technology 10 (2002).
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array, runs, within
from emaphm.recording.conditioning.gaps import interval_of
from emaphm.recording.conditioning.interpolation import HELD, curve
from emaphm.recording.schema import SCHEMA

NOT_CHECKED = ("time_s", "command_rad", "angle_rad", *HELD)
"""Channels without outlier check: they are exact, or have jumps."""


@dataclass(frozen=True)
class OutlierRule:
    """Thresholds of the outlier rule.

    The largest deviation is 0.6 times the threshold over 1,850 clean channels (two drives, six commands, 25
    Hz to 5 kHz, healthy and three faults), the channels of eight logs of a servo and of 445 cycles of a ball
    screw (``tests/recording/test_outliers.py`` repeats a part of this).
    """

    half_width: int = 3
    """Number of rows on either side whose median a row is compared with [-]."""

    most_rows: int = 2
    """Longest outlier [rows]: the median of seven rows is robust to three; the third is a margin for the
    spread."""

    deviation: float = 10.0
    """Least deviation of an outlier from the median, relative to the spread [-]. Clean channels reach 6."""

    usual: float = 0.98
    """Quantile of all deviations that defines their usual size [-]: up to 2 % of outliers do not change
    it."""

    fewest_above: int = 10
    """Least number of rows above that quantile [-], in a short recording."""

    beyond_range: float = 1.0
    """Least deviation outside the channel's range, relative to its usual distance from its median [-]."""

    dropped_out: float = 0.1
    """The same threshold for a row that is exactly 0 [-]."""

    jump: float = 1e-2
    """Least second difference of the command at a jump, relative to its range [-]."""

    corner: float = 0.5
    """The same relative to its largest step between rows [-]: friction reverses where a ramp reverses."""

    after_jump_s: float = 0.05
    """Time after a jump of the command without outlier check [s]: the current pulse of a start is no
    outlier."""


RULE = OutlierRule()


def without_outliers(
    channels: dict[str, Array], constants: Collection[str]
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return channels with outliers replaced by interpolation of the other rows, and a note on each channel.

    Parameters
    ----------
    channels
        Arrays (n,) by name, finite.
    constants
        Channels that were not measured.

    Returns
    -------
    Arrays (n,) by name, the same objects for channels without outliers; notes.
    """
    time, cleaned = channels["time_s"], dict(channels)
    notes: tuple[str, ...] = ()
    checked = ~_after_jumps(channels["command_rad"], time)
    for name, values in channels.items():
        if name not in SCHEMA or name in NOT_CHECKED or name in constants:
            continue
        is_outlier = outliers(values) & checked
        if not np.any(is_outlier):
            continue
        rows = np.flatnonzero(is_outlier)
        cleaned[name] = values.copy()
        cleaned[name][rows] = curve(time[~is_outlier], values[~is_outlier], time[rows])
        worst = rows[np.argmax(np.abs(values[rows] - cleaned[name][rows]))]
        note = f"{name}: {rows.size} outlier{'s' if rows.size > 1 else ''} replaced by interpolation, the "
        note += f"largest {values[worst]:.4g} at {time[worst]:.6g} s, where its neighbours imply "
        notes += (f"{note}{cleaned[name][worst]:.4g}",)
    return cleaned, notes


@np.errstate(over="ignore", invalid="ignore")  # a broken sensor may give 1e308; the checks come after
def outliers(values: Array) -> NDArray[np.bool_]:
    """Return whether each row of a channel (n,) is an outlier, without regard to the command."""
    n, half = values.size, RULE.half_width
    none = np.zeros(n, bool)
    steps = np.abs(np.diff(values))
    if n <= 2 * (half + RULE.fewest_above) or not np.any(steps):
        return none
    windows = np.lib.stride_tricks.sliding_window_view(values, 2 * half + 1)
    inner = slice(half, n - half)
    medians = np.median(windows, axis=1)
    deviation = np.abs(values[inner] - medians)
    share = min(RULE.usual, 1 - RULE.fewest_above / n)
    # If a channel mostly stands still, one converter count is the usual deviation.
    usual = max(float(np.quantile(deviation, share)), float(steps[steps > 0].min()))
    # Spread of each window without its largest deviations, which may be the outlier.
    spread = np.partition(np.abs(windows - medians[:, None]), -1 - RULE.most_rows, axis=1)[
        :, -1 - RULE.most_rows
    ]
    middle = float(np.median(values))
    distance = float(np.quantile(np.abs(values - middle), min(0.99, share)))
    far = deviation > RULE.deviation * np.maximum(usual, 2 * spread)
    outside = deviation > RULE.beyond_range * distance
    dropped = (values[inner] == 0) & (deviation > RULE.dropped_out * distance)
    is_outlier = none.copy()
    is_outlier[inner] = far & (outside | dropped)
    for start, stop in runs(is_outlier):
        if stop - start > RULE.most_rows:
            is_outlier[start:stop] = False
    return is_outlier


@np.errstate(over="ignore", invalid="ignore")
def _after_jumps(command: Array, time: Array) -> NDArray[np.bool_]:
    """Return whether each row (n,) lies within `RULE.after_jump_s` after a jump or corner of the command."""
    bend = np.abs(np.diff(command, 2))
    least = min(RULE.jump * np.ptp(command), RULE.corner * np.max(np.abs(np.diff(command)), initial=0.0))
    rows = max(RULE.half_width, int(np.ceil(RULE.after_jump_s / interval_of(time))))
    places = np.flatnonzero(bend > least) + 1
    starts, stops = np.maximum(places - RULE.half_width, 0), np.minimum(places + rows + 1, command.size)
    return within(starts, stops, command.size)
