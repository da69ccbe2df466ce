"""Isolated outliers and drop-outs of one or two rows, replaced by what their neighbours imply.

A Hampel-like rule: the deviation from the running median, against a robust local spread. The chopped current
of a hysteresis drive, the current pulse of a start and the voltage of a switching drive deviate from their
running median too, so that three things must come together: the row deviates far from the median of its
neighbours, relative to how rows usually deviate and to how its own neighbours do; it leaves the channel's
usual range, or it is exactly 0; and the command did not jump just before.

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

from emaphm.arrays import Array, runs
from emaphm.recording.conditioning.gaps import interval_of
from emaphm.recording.conditioning.interpolation import HELD, curve
from emaphm.recording.schema import SCHEMA

NOT_JUDGED = ("time_s", "command_rad", "angle_rad", *HELD)
"""Known exactly, or with jumps of their own."""


@dataclass(frozen=True)
class OutlierRule:
    """When a row is an outlier.

    Over 1,850 clean channels (two drives, six commands, 25 Hz to 5 kHz, healthy and three faults), those of
    eight logs of a servo and of 445 cycles of a ball screw the largest deviation is 0.6 times what the rule
    asks (``tests/recording/test_outliers.py`` repeats a part of it).
    """

    half_width: int = 3
    """Rows to either side whose median a row is compared with [-]."""

    most_rows: int = 2
    """Longest outlier [rows]: a median of seven rows sees through three; one of them is left for the
    spread."""

    deviation: float = 10.0
    """Least deviation from the median, relative to the spread [-]. Clean channels reach 6."""

    usual: float = 0.98
    """Quantile of all deviations that is their usual size [-]: up to 2 % of outliers do not change it."""

    fewest_above: int = 10
    """Rows above that quantile at least [-], in a short recording."""

    beyond_range: float = 1.0
    """Least deviation, relative to the channel's usual distance from its median, that leaves its range
    [-]."""

    dropped_out: float = 0.1
    """The same for a row that is exactly 0 [-]."""

    jump: float = 1e-2
    """Second difference of the command, relative to its range, that is a jump [-]."""

    corner: float = 0.5
    """The same relative to its largest step from row to row [-]: where a ramp turns round, friction does."""

    after_jump_s: float = 0.05
    """Time after a jump of the command in which nothing is judged [s]: what starts a motor is a pulse too."""


RULE = OutlierRule()


def without_outliers(
    channels: dict[str, Array], constants: Collection[str]
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return channels with outliers replaced by a curve through the other rows, and a note on each channel.

    Parameters
    ----------
    channels
        Arrays (n,) by name, finite.
    constants
        Those that were not measured.

    Returns
    -------
    The same arrays where nothing was found; notes.
    """
    time, cleaned = channels["time_s"], dict(channels)
    notes: tuple[str, ...] = ()
    judged = ~_after_jumps(channels["command_rad"], time)
    for name, values in channels.items():
        if name not in SCHEMA or name in NOT_JUDGED or name in constants:
            continue
        found = outliers(values) & judged
        if not np.any(found):
            continue
        rows = np.flatnonzero(found)
        cleaned[name] = values.copy()
        cleaned[name][rows] = curve(time[~found], values[~found], time[rows])
        worst = rows[np.argmax(np.abs(values[rows] - cleaned[name][rows]))]
        note = f"{name}: {rows.size} outlier{'s' if rows.size > 1 else ''} replaced by interpolation, the "
        note += f"largest {values[worst]:.4g} at {time[worst]:.6g} s, where its neighbours imply "
        notes += (f"{note}{cleaned[name][worst]:.4g}",)
    return cleaned, notes


@np.errstate(over="ignore", invalid="ignore")  # a broken sensor may give 1e308; the checks come after
def outliers(values: Array) -> NDArray[np.bool_]:
    """Return which rows of a channel (n,) are outliers, whatever the command does."""
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
    # Of a channel that mostly stands still, one count is the usual deviation.
    usual = max(float(np.quantile(deviation, share)), float(steps[steps > 0].min()))
    # Row by row: what remains of the window without the outlier.
    spread = np.partition(np.abs(windows - medians[:, None]), -1 - RULE.most_rows, axis=1)[
        :, -1 - RULE.most_rows
    ]
    middle = float(np.median(values))
    distance = float(np.quantile(np.abs(values - middle), min(0.99, share)))
    far = deviation > RULE.deviation * np.maximum(usual, 2 * spread)
    outside = deviation > RULE.beyond_range * distance
    dropped = (values[inner] == 0) & (deviation > RULE.dropped_out * distance)
    found = none.copy()
    found[inner] = far & (outside | dropped)
    for start, stop in runs(found):
        if stop - start > RULE.most_rows:
            found[start:stop] = False
    return found


@np.errstate(over="ignore", invalid="ignore")
def _after_jumps(command: Array, time: Array) -> NDArray[np.bool_]:
    bend = np.abs(np.diff(command, 2))
    least = min(RULE.jump * np.ptp(command), RULE.corner * np.max(np.abs(np.diff(command)), initial=0.0))
    rows = max(RULE.half_width, int(np.ceil(RULE.after_jump_s / interval_of(time))))
    places = np.flatnonzero(bend > least) + 1
    marks = np.zeros(command.size + 1)
    np.add.at(marks, np.maximum(places - RULE.half_width, 0), 1)
    np.add.at(marks, np.minimum(places + rows + 1, command.size), -1)
    return np.cumsum(marks[:-1]) > 0
