"""Conversion of a file's columns into channels: one time base, units, scales, derived channels."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.actuator.channels import OWN_NAME, ChannelEntry
from emaphm.actuator.columns.expression import Expression
from emaphm.actuator.quantity import Coordinates, unit_for
from emaphm.arrays import Array
from emaphm.errors import RecordingError
from emaphm.recording.checks import check_lengths
from emaphm.recording.conditioning.gaps import FEWEST_ROWS, covered_rows
from emaphm.recording.conditioning.interpolation import HELD, continuous, curve, last_state, moved
from emaphm.recording.io.channel_names import Source, columns_of, missing_name, resolved
from emaphm.recording.io.file_columns import FileColumns
from emaphm.recording.schema import SCHEMA


@dataclass(frozen=True)
class Table:
    """Channels and further columns of a file, on one time base.

    Parameters
    ----------
    channels
        Arrays (n,) by schema name, in SI units; NaN where a cell is empty.
    further
        Arrays (n,) of numbers or texts by their names in the file.
    sources
        Source of each channel in the file.
    constants
        Channels with a given value for the whole file.
    notes
        Sentences on the changes of the columns.
    """

    channels: dict[str, Array]
    further: dict[str, NDArray[Any]]
    sources: Mapping[str, Source]
    constants: tuple[str, ...] = ()
    notes: list[str] = field(default_factory=list)

    @property
    def rows(self) -> int:
        """Number of rows n."""
        return self.channels["time_s"].size

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the arrays (n,) that a condition may name: the file's columns and the channels."""
        return {**self.channels, **self.further}


def table_of(
    file: FileColumns,
    sources: Mapping[str, Source],
    actuator: Actuator,
    source: str,
    *,
    needed: Sequence[str] = (),
    known: Mapping[str, float] | None = None,
) -> Table:
    """Return the channels and further columns of a file.

    Parameters
    ----------
    file
        Columns of the file.
    sources
        Source of each channel in the file.
    actuator
        Gives the coordinates (m or rad), the sampling of the rows and the longest gap.
    source
        The file's name, for errors.
    needed
        Further columns named by a condition or by the way to cut.
    known
        Values of channels, in their SI unit, for the whole file.

    Raises
    ------
    RecordingError
        A unit is of another quantity than its channel, a column of an expression is absent, a named column
        holds neither numbers nor texts, lengths differ, or the times of a column cannot be used.
    """
    notes: list[str] = []
    signals = _signals(file, sources, source)
    wanted = signals | set(needed)
    for name in sorted(wanted & file.unusable.keys() - file.texts.keys() - sources.keys()):
        raise RecordingError(f"{source}: column '{name}' {file.unusable[name]}")
    # A column of a condition or a cut is a state, which is held: there is no value between two states.
    states = wanted - signals
    names = [name for name in file.numeric if name in wanted]
    file, time = _on_one_base(file, sources, names, states, actuator, source, notes)
    channels: dict[str, Array] = {"time_s": time}
    for name, channel_source in sources.items():
        if name != "time_s" and channel_source.column is not None:
            channels[name] = _converted(
                name, channel_source, file.numeric[channel_source.column], actuator, source
            )
    # Before rows are selected: a longer column would lose its last rows without notice.
    check_lengths(channels, source, {name: origin.label for name, origin in sources.items()})
    for name, channel_source in sources.items():
        if channel_source.column is None and channel_source.entry.derived is not None:
            channels[name] = _derived(name, channel_source, file, channels, actuator, source)
    constants = {}
    for name, channel_source in sources.items():
        if channel_source.entry.value is not None and channel_source.column is None:
            constants[name] = _converted(
                name, channel_source, np.full(time.shape, channel_source.entry.value), actuator, source
            )
    for name, value in (known or {}).items():
        constants[name] = np.full(time.shape, value)
        notes.append(f"{name} = {value:g} was given for the whole recording")
    used = {channel_source.column for channel_source in sources.values()} | set(SCHEMA)
    further: dict[str, NDArray[Any]] = {
        name: values
        for name, values in {**file.numeric, **file.texts}.items()
        if values.shape == time.shape and (name not in used or name in needed)
    }
    ordered = {name: {**channels, **constants}[name] for name in SCHEMA if name in {*channels, *constants}}
    return Table(ordered, further, sources, tuple(constants), notes)


def _signals(file: FileColumns, sources: Mapping[str, Source], source: str) -> set[str]:
    """Return the columns of channels, including those of expressions from which channels are derived."""
    columns = [*file.numeric, *file.unusable]
    entries = [channel_source.entry for channel_source in sources.values()]
    signals = {
        channel_source.column for channel_source in sources.values() if channel_source.column is not None
    }
    for entry in entries:
        if entry.derived is not None:
            signals |= set(columns_of(Expression.parse(entry.derived), columns, source).values())
    return signals


def _on_one_base(
    file: FileColumns,
    sources: Mapping[str, Source],
    wanted: Sequence[str],
    states: Collection[str],
    actuator: Actuator,
    source: str,
    notes: list[str],
) -> tuple[FileColumns, Array]:
    """Return the file with all `wanted` columns on the times of the command, and these times (n,) [s].

    States are held until their next row. Rows that any of the columns does not cover are left out.
    """
    named = {
        channel_source.column: _times_in_file(channel_source.entry, file, sources, actuator, source)
        for channel_source in sources.values()
        if channel_source.column is not None and channel_source.entry.time is not None
    }
    times = {**file.times, **named}
    if "time_s" in sources:
        time_source = sources["time_s"]
        base = _converted("time_s", time_source, file.numeric[str(time_source.column)], actuator, source)
        clock = _times_of_format(str(time_source.column), wanted, file, base)
    else:
        leading = next((name for name in (sources["command_rad"].column, *wanted) if name in times), None)
        if leading is None:
            raise RecordingError(
                f"{source}: no column 'time_s', and the file has no times of the columns that are read; "
                'export them with their times, or put time_s = "that name" under [channels] in the '
                "actuator's TOML"
            )
        base = clock = times[leading]
    numeric = dict(file.numeric)
    held = {*states, *(channel_source.column for name, channel_source in sources.items() if name in HELD)}
    angle = sources.get("angle_rad", Source(OWN_NAME))
    bases: dict[int, list[str]] = {}
    for name in wanted:
        own, rows_at = times.get(name), base if name in named else clock
        if own is None or np.array_equal(own, rows_at):
            continue
        values = numeric[name]
        if name == angle.column:
            values = _without_turns(angle, values, actuator, source)
        numeric[name] = _moved(name, own, values, rows_at, actuator, source, holds=name in held)
        bases.setdefault(own.size, []).append(name)
    notes += [
        f"{', '.join(names)}: brought from times of their own to those of the command"
        for names in bases.values()
    ]
    interpolated = {name: numeric[name] for names in bases.values() for name in names}
    rows, left_out = covered_rows(interpolated, base.size, source)
    notes += left_out
    texts = {name: _cut(values, rows, base.size) for name, values in file.texts.items()}
    numeric = {name: _cut(values, rows, base.size) for name, values in numeric.items()}
    return FileColumns(numeric, file.unusable, texts), base[rows]


def _times_of_format(time: str, wanted: Sequence[str], file: FileColumns, base: Array) -> Array:
    """Return the format's times (n,) [s] of the rows of column `time`, else its values `base` (n,).

    A column of times has priority over the times of the format, which may be a default only and may have
    another origin. Columns of other groups are interpolated at these rows according to the format's times.
    """
    group = time.rpartition("/")[0]
    for name in (time, *wanted):
        own = file.times.get(name)
        if own is not None and own.size == base.size and name.rpartition("/")[0] == group:
            return own
    return base


def _cut(values: NDArray[Any], rows: slice, size: int) -> NDArray[Any]:
    return values[rows] if values.size == size else values


def _without_turns(angle: Source, raw: Array, actuator: Actuator, source: str) -> Array:
    """Return a raw column of an angle, in its own unit, unwrapped if its sensor restarts with every turn."""
    at_zero, at_one = _converted("angle_rad", angle, np.array([0.0, 1.0]), actuator, source)
    return np.asarray(continuous((at_one - at_zero) * raw) / (at_one - at_zero))


def _times_in_file(
    entry: ChannelEntry, file: FileColumns, sources: Mapping[str, Source], actuator: Actuator, source: str
) -> Array:
    column = resolved(str(entry.time), list(file.numeric), source)
    if column is None:
        raise RecordingError(
            f"{source}: no column '{entry.time}', which [channels] in the actuator's TOML gives as time"
            f"{missing_name(str(entry.time), list(file.numeric))}; correct the name there"
        )
    unit = sources["time_s"] if "time_s" in sources else Source(ChannelEntry())
    return _converted("time_s", unit, file.numeric[column], actuator, source)


def _moved(
    name: str,
    times: Array,
    values: Array,
    base: Array,
    actuator: Actuator,
    source: str,
    *,
    holds: bool,
) -> Array:
    """Return a column on the times `base` (n,) [s]; NaN in gaps that are too long to be interpolated."""
    if times.shape != values.shape:
        raise RecordingError(
            f"{source}: column '{name}' has {values.size} rows, its times have {times.size}; give the "
            "times of this column"
        )
    if base.size < 2:
        raise RecordingError(f"{source}: too short: {base.size} rows; record a longer manoeuvre")
    known = np.isfinite(values) & np.isfinite(times)
    known_times, steps = times[known], np.diff(times[known])
    if known_times.size < (1 if holds else 2) or np.any(steps <= 0) or np.any(np.diff(base) <= 0):
        raise RecordingError(
            f"{source}: column '{name}' has times of its own, which do not increase; export it with the "
            "times of the command"
        )
    if holds:
        return last_state(known_times, values[known], base)
    interpolated = moved(*_between(times, values, known), base, actuator.channels.sampling)
    # The 90 % quantile, since a column that is logged on change has long steps which are no gaps.
    usual = float(np.percentile(steps, 90))
    for i in np.flatnonzero(steps > (actuator.reading.longest_gap + 1.25) * usual):
        in_gap = (base > known_times[i] + 1e-6 * usual) & (base < known_times[i + 1] - 1e-6 * usual)
        interpolated[in_gap] = np.nan
    return interpolated


def _between(times: Array, values: Array, known: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return times (m,) and values (m,) from the first `known` row (n,) to the last, gaps interpolated.

    Without the interpolated rows, the mean of a row would also count for the empty rows after it.
    """
    places = np.flatnonzero(known)
    rows = np.flatnonzero(np.isfinite(times))
    rows = rows[(rows >= places[0]) & (rows <= places[-1])]
    if rows.size == places.size or places.size < FEWEST_ROWS or np.any(np.diff(times[rows]) <= 0):
        return times[known], values[known]
    filled = curve(times[known], values[known], times[rows])
    return times[rows], np.where(known[rows], values[rows], filled)


def _converted(name: str, channel_source: Source, raw: Array, actuator: Actuator, source: str) -> Array:
    """Return a raw column (n,) of channel `name` with the scale, offset, sign and unit of its entry."""
    entry = channel_source.entry
    if not entry.converts:
        return raw
    with np.errstate(over="ignore", invalid="ignore"):  # the checks refuse what is not finite
        values = entry.sign * (entry.scale * raw + entry.offset)
    if entry.unit is None:
        return values
    from emaphm.actuator.columns.units import in_unit

    target = unit_for(SCHEMA[name].unit, actuator.coordinates)
    try:
        return in_unit(values, entry.unit, target)
    except ValueError as error:
        fitting = [
            f'"{coordinates}"'
            for coordinates in get_args(Coordinates)
            if _converts(entry.unit, name, coordinates)
        ]
        hint = f", or set coordinates = {' or '.join(fitting)}" if fitting else ""
        raise RecordingError(
            f"{source}: unit of {name} under [channels] in the actuator's TOML: {error}; correct the "
            f"unit{hint}"
        ) from None


def check_units(actuator: Actuator, names: Iterable[str], source: str) -> None:
    """Refuse a unit in the entries of the channels `names` that belongs to another quantity.

    Raises
    ------
    RecordingError
        The same as `table_of` raises when such an entry is applied.
    """
    for name in names:
        _converted(name, Source(actuator.channels.entry(name)), np.zeros(1), actuator, source)


def _converts(unit: str, name: str, coordinates: str) -> bool:
    """Return whether `unit` is a unit of channel `name` in these coordinates."""
    from emaphm.actuator.columns.units import in_unit

    try:
        in_unit(np.zeros(1), unit, unit_for(SCHEMA[name].unit, coordinates))
    except ValueError:
        return False
    return True


def _derived(
    name: str,
    channel_source: Source,
    file: FileColumns,
    channels: Mapping[str, Array],
    actuator: Actuator,
    source: str,
) -> Array:
    expression = Expression.parse(str(channel_source.entry.derived))
    operands = operands_of(
        expression, {**file.texts, **file.numeric}, channels, source, f"{name} is derived from"
    )
    try:
        raw = np.asarray(expression.evaluate(operands), float)
    except ValueError as error:
        raise RecordingError(f"{source}: {name}, derived as '{expression.text}': {error}") from None
    if raw.shape != channels["time_s"].shape:
        raise RecordingError(
            f"{source}: {name}, derived as '{expression.text}', has {raw.size} rows, the time has "
            f"{channels['time_s'].size}; give columns of the same length"
        )
    return _converted(name, channel_source, raw, actuator, source)


def operands_of(
    expression: Expression,
    columns: Mapping[str, NDArray[Any]],
    channels: Mapping[str, Array],
    source: str,
    role: str,
) -> dict[str, NDArray[Any]]:
    """Return the arrays (n,) that an expression names: columns of the file, else channels of the schema.

    `role` continues "no column 'x', which …" in the error.

    Raises
    ------
    RecordingError
        A name is neither a column nor a channel, or the arrays differ in length.
    """
    in_file = columns_of(expression, list(columns), source)
    operands = {}
    for name in expression.names:
        if name in in_file:
            operands[name] = columns[in_file[name]]
        elif name in channels:
            operands[name] = channels[name]
        else:
            raise RecordingError(
                f"{source}: no column '{name}', which {role} in the actuator's TOML"
                f"{missing_name(name, [*columns, *channels])}; correct the name there"
            )
    sizes = {values.size for values in operands.values()}
    if len(sizes) > 1:
        raise RecordingError(
            f"{source}: the columns of '{expression.text}' have {' and '.join(map(str, sorted(sizes)))} "
            "rows; give columns of the same length"
        )
    return operands
