"""Checks that every recording must pass for any actuator; each error names column, row and remedy."""

from collections.abc import Collection, Mapping

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import RecordingError, nearest
from emaphm.recording.schema import PHASES, RESPONSES, SCHEMA

FEWEST_SAMPLES = 50
"""Fewer rows than this cannot identify eight faults."""

STEP_TOLERANCE = 0.01
"""Largest deviation of a time step from the sample interval, relative to it, for uniform sampling."""

LARGEST_SHIFT = 0.5
"""Largest shift of a row from its time at a constant rate [steps] for uniform sampling."""

MOST_JITTER = 0.25
"""Largest rms deviation of the time steps from the sample interval, relative to it, at which rows are
resampled. Beyond it, the mean rate of the rows does not indicate their time resolution."""

GAP = 1.75
"""A time step of this number of sample intervals means a lost row, whose values cannot be interpolated."""

NEEDED = (
    "time_s, command_rad, and one or more of current_A (or the three phase currents with angle_rad), "
    + ", ".join(name for name in RESPONSES if name != "current_A")
)

COUNTING = "rows count from 1, the header not included"


def check(columns: Mapping[str, Array], source: str, labels: Mapping[str, str] | None = None) -> None:
    """Refuse columns that do not form a valid recording.

    Parameters
    ----------
    columns
        Arrays of shape (n,) by schema name, in SI units. Columns beyond the schema are only checked for the
        same length.
    source
        File or description, named in an error.
    labels
        Names in the file by schema name, if they differ.

    Raises
    ------
    RecordingError
        A needed column is missing, lengths differ, there are fewer than 50 rows, a value is not
        finite, time does not increase, has a gap or jitters too much, or the command is 0 throughout.
    """
    labels = {name: _label(name, labels or {}) for name in columns}
    complaint = (
        _missing(columns)
        or _misshapen(columns, labels)
        or _not_finite(columns, labels)
        or _not_increasing(columns["time_s"], labels["time_s"])
        or _time_steps(columns["time_s"], labels["time_s"])
        or _nothing_commanded(columns["command_rad"], labels["command_rad"])
    )
    if complaint:
        raise RecordingError(f"{source}: {complaint}")


def check_lengths(columns: Mapping[str, Array], source: str, labels: Mapping[str, str]) -> None:
    """Raise `RecordingError` if a column has another number of rows than `time_s`; arguments of `check`."""
    complaint = _unequal(columns, {name: _label(name, labels) for name in columns})
    if complaint:
        raise RecordingError(f"{source}: {complaint}")


def check_values(columns: Mapping[str, Array], source: str, labels: Mapping[str, str]) -> None:
    """Raise `RecordingError` for a value that is not finite, or a time that does not increase.

    The arguments are those of `check`.
    """
    labels = {name: _label(name, labels) for name in columns}
    complaint = _not_finite(columns, labels) or _not_increasing(columns["time_s"], labels["time_s"])
    if complaint:
        raise RecordingError(f"{source}: {complaint}")


def missing_columns(present: Collection[str]) -> tuple[str, ...]:
    """Return the required columns that are not among `present`.

    Without any of `RESPONSES`, `current_A` is missing, or if phase currents are present, the other phase
    currents and the angle.
    """
    missing = [name for name in ("time_s", "command_rad") if name not in present]
    if not any(name in present for name in RESPONSES):
        has_phases = any(name in present for name in PHASES)
        current = (*PHASES, "angle_rad") if has_phases else ("current_A",)
        missing += [name for name in current if name not in present]
    return tuple(missing)


def _label(name: str, labels: Mapping[str, str]) -> str:
    given = labels.get(name, name)
    return f"'{name}'" if given == name else f"'{given}' ({name})"


def _missing(columns: Mapping[str, Array]) -> str | None:
    missing = missing_columns(columns)
    if not missing:
        return None
    foreign = [name for name in columns if name not in SCHEMA]
    hint = nearest(missing[0], foreign) if foreign else ""
    return f"column '{missing[0]}' is missing{hint}; a recording needs {NEEDED}"


def _misshapen(columns: Mapping[str, Array], labels: Mapping[str, str]) -> str | None:
    for name, values in columns.items():
        if values.ndim != 1:
            return f"column {labels[name]} has shape {values.shape}; give one value a row"
    if complaint := _unequal(columns, labels):
        return complaint
    rows = columns["time_s"].size
    if rows < FEWEST_SAMPLES:
        return f"too short: {rows} rows, at least {FEWEST_SAMPLES} are needed; record a longer manoeuvre"
    return None


def _unequal(columns: Mapping[str, Array], labels: Mapping[str, str]) -> str | None:
    rows = columns["time_s"].size
    for name, values in columns.items():
        if values.size != rows:
            return (
                f"column {labels[name]} has {values.size} rows, {labels['time_s']} has {rows}; "
                "give all columns the same length"
            )
    return None


def _not_finite(columns: Mapping[str, Array], labels: Mapping[str, str]) -> str | None:
    for name in SCHEMA:
        bad = np.flatnonzero(~np.isfinite(columns[name])) if name in columns else np.empty(0)
        if bad.size:
            more = f" (and {bad.size - 1} more)" if bad.size > 1 else ""
            return (
                f"row {bad[0] + 1} of column {labels[name]} is empty or not a finite number{more}; "
                f"correct that value, or cut the recording there ({COUNTING})"
            )
    return None


def _not_increasing(time: Array, label: str) -> str | None:
    back = np.flatnonzero(time[1:] <= time[:-1])
    if not back.size:
        return None
    row = back[0] + 2
    return (
        f"time does not increase at row {row} of column {label} ({time[row - 2]:.9g} s, then "
        f"{time[row - 1]:.9g} s); sort the rows and drop repeated ones ({COUNTING})"
    )


def _time_steps(time: Array, label: str) -> str | None:
    with np.errstate(over="ignore"):
        steps = np.diff(time)
    if is_uniform(time):
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        # Relative to the mean, not the median: a gap of any length exceeds it.
        relative = steps / steps.mean()
        jitter = float(np.sqrt(np.mean((relative - 1) ** 2)))
    gaps = np.flatnonzero(~(relative < GAP))
    if not gaps.size and jitter <= MOST_JITTER:
        return None
    row = int(gaps[0] if gaps.size else np.argmax(np.abs(relative - 1))) + 2
    return (
        f"sampling is not uniform: row {row} of column {label} comes {steps[row - 2]:.6g} s after "
        f"the one before it, where {np.median(steps):.6g} s is usual; cut the recording there, resample "
        f"to a constant rate, or store more digits of time ({COUNTING})"
    )


def is_uniform(time: Array) -> bool:
    """Return whether `time` (n,) is sampled uniformly.

    All steps are within `STEP_TOLERANCE` of their median, and no row deviates by more than `LARGEST_SHIFT` of
    a step from its time at a constant rate: small deviations of a clock whose rate drifts add up.
    """
    steps = np.diff(time)
    interval = np.median(steps)
    even = np.linspace(time[0], time[-1], time.size)
    return bool(
        np.all(np.abs(steps - interval) <= STEP_TOLERANCE * interval)
        and np.max(np.abs(time - even)) <= LARGEST_SHIFT * interval
    )


def _nothing_commanded(command: Array, label: str) -> str | None:
    if np.any(command):
        return None
    return f"nothing was commanded: column {label} is 0 throughout; a manoeuvre must move the actuator"
