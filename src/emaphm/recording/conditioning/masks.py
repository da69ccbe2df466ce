"""Masks of the rows of a file that are used: by a condition, by time, without long rests of the command."""

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator.columns.expression import Expression
from emaphm.actuator.reading import Reading
from emaphm.arrays import Array, within
from emaphm.errors import RecordingError
from emaphm.recording.conditioning.gaps import interval_of
from emaphm.recording.conditioning.table import Table, operands_of

REST = 1e-4
"""Largest change of a command at rest, relative to its range [-]. A sine stays within it at a peak for 0.6 %
of its period."""


def kept_rows(table: Table, reading: Reading, source: str) -> NDArray[np.bool_]:
    """Return whether each row (n,) of a file is used.

    Raises
    ------
    RecordingError
        A column of the condition is absent, or no row is left; the message names the mask.
    """
    time = table.channels["time_s"]
    kept = np.ones(time.size, bool)
    if reading.keep is not None:
        expression = Expression.parse(reading.keep)
        operands = operands_of(expression, table.further, table.channels, source, "the condition keep names")
        try:
            condition = np.asarray(expression.holds(operands))
        except ValueError as error:
            raise RecordingError(
                f'{source}: keep = "{reading.keep}": {error}; compare like with like'
            ) from None
        if condition.shape != time.shape:
            raise RecordingError(
                f'{source}: keep = "{reading.keep}" gives {condition.size} values for {time.size} rows; name '
                "columns that have a value for each row"
            )
        kept &= condition
        _check_not_empty(kept, f'keep = "{reading.keep}"', source)
    if reading.times:
        kept &= np.logical_or.reduce([(time >= first) & (time <= last) for first, last in reading.times])
        _check_not_empty(kept, f"times = {[list(limits) for limits in reading.times]}", source)
    if reading.dwell_s is not None:
        kept &= ~at_rest(time, table.channels["command_rad"], reading.dwell_s)
        _check_not_empty(kept, f"dwell_s = {reading.dwell_s:g}", source)
    return kept


@np.errstate(over="ignore", invalid="ignore")
def at_rest(time: Array, command: Array, least_s: float) -> NDArray[np.bool_]:
    """Return whether each row (n,) lies in a rest of the command of at least `least_s` [s].

    Empty cells (NaN) do not end a rest.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    interval = interval_of(time)
    known = command[np.isfinite(command)]
    if not known.size or not np.isfinite(interval):
        return np.zeros(command.size, bool)
    rows = max(2, round(min(least_s / interval, command.size + 1)) + 1)
    if rows > command.size:
        return np.zeros(command.size, bool)
    # A filter of n rows at row i covers rows i - n // 2 to i - n // 2 + n - 1.
    # The filters lose values next to NaN.
    empty = np.isnan(command)
    swing = maximum_filter1d(np.where(empty, -np.inf, command), rows, mode="nearest")
    swing -= minimum_filter1d(np.where(empty, np.inf, command), rows, mode="nearest")
    middle = np.arange(command.size)
    complete = (middle - rows // 2 >= 0) & (middle - rows // 2 + rows <= command.size)
    starts = np.flatnonzero(complete & (swing <= REST * np.ptp(known))) - rows // 2
    return within(starts, starts + rows, command.size)


def _check_not_empty(kept: NDArray[np.bool_], mask: str, source: str) -> None:
    if not np.any(kept):
        raise RecordingError(
            f"{source}: {mask} under [reading] in the actuator's TOML leaves no row of {kept.size}; correct "
            "it, or take it out"
        )
