"""The rows of a file as channels: columns on one time base, converted, scaled, and reckoned from others."""

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
from emaphm.recording.conditioning.gaps import FEWEST_ROWS, covered_rows
from emaphm.recording.conditioning.interpolation import HELD, continuous, curve, last_state, moved
from emaphm.recording.io.channel_names import Source, columns_of, missing_name, resolved
from emaphm.recording.io.file_columns import FileColumns
from emaphm.recording.schema import SCHEMA


@dataclass(frozen=True)
class Table:
    """What the rows of a file hold.

    Parameters
    ----------
    channels
        Arrays (n,) by schema name, in SI units; NaN where a cell is empty.
    further
        Arrays (n,) of numbers or texts by their names in the file.
    sources
        Where each of `channels` comes from.
    constants
        Channels known for the whole file.
    notes
        What was done.
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
        """Return what a condition may name: the file's columns, and the channels."""
        return {**self.channels, **self.further}


def table_of(
    held: FileColumns,
    sources: Mapping[str, Source],
    actuator: Actuator,
    source: str,
    *,
    needed: Sequence[str] = (),
    known: Mapping[str, float] | None = None,
) -> Table:
    """Return the channels of a file.

    Parameters
    ----------
    held
        What the file holds.
    sources
        Where each channel comes from.
    actuator
        Whose coordinates say whether m or rad is meant, and how rows were sampled.
    source
        The file's name, for errors.
    needed
        Further columns that a condition or a cut names.
    known
        Values of channels, in their SI unit, which stand for the whole file.

    Raises
    ------
    RecordingError
        A unit is of another quantity than its channel, a column of an expression is absent, a named one
        holds neither numbers nor texts, lengths differ, or times of a column cannot be used.
    """
    notes: list[str] = []
    signals = _signals(held, sources, source)
    wanted = signals | set(needed)
    for name in sorted(wanted & held.unusable.keys() - held.texts.keys() - sources.keys()):
        raise RecordingError(f"{source}: column '{name}' {held.unusable[name]}")
    # What a condition or a cut names is a state: nothing lies between two of them.
    states = wanted - signals
    names = [name for name in held.numeric if name in wanted]
    held, time = _on_one_base(held, sources, names, states, actuator, source, notes)
    channels: dict[str, Array] = {"time_s": time}
    for name, where in sources.items():
        if name != "time_s" and where.column is not None:
            channels[name] = _converted(name, where, held.numeric[where.column], actuator, source)
    for name, where in sources.items():
        if where.column is None and where.entry.derived is not None:
            channels[name] = _derived(name, where, held, channels, actuator, source)
    constants = {}
    for name, where in sources.items():
        if where.entry.value is not None and where.column is None:
            constants[name] = _converted(
                name, where, np.full(time.shape, where.entry.value), actuator, source
            )
    for name, value in (known or {}).items():
        constants[name] = np.full(time.shape, value)
        notes.append(f"{name} = {value:g} was given for the whole recording")
    taken = {where.column for where in sources.values()} | set(SCHEMA)
    further: dict[str, NDArray[Any]] = {
        name: values
        for name, values in {**held.numeric, **held.texts}.items()
        if values.shape == time.shape and (name not in taken or name in needed)
    }
    ordered = {name: {**channels, **constants}[name] for name in SCHEMA if name in {*channels, *constants}}
    return Table(ordered, further, sources, tuple(constants), notes)


def _signals(held: FileColumns, sources: Mapping[str, Source], source: str) -> set[str]:
    """Return the columns that channels are, or are derived from."""
    columns = [*held.numeric, *held.unusable]
    signals = {where.column for where in sources.values() if where.column is not None}
    for where in sources.values():
        if where.entry.derived is not None:
            signals |= set(columns_of(Expression.parse(where.entry.derived), columns, source).values())
    return signals


def _on_one_base(
    held: FileColumns,
    sources: Mapping[str, Source],
    wanted: Sequence[str],
    states: Collection[str],
    actuator: Actuator,
    source: str,
    notes: list[str],
) -> tuple[FileColumns, Array]:
    """Return the file with all `wanted` columns on the times of the command, and these times (n,) [s].

    States hold until their next row. Rows that one of the columns does not cover are left out.
    """
    named = {
        where.column: _times_in_file(where.entry, held, sources, actuator, source)
        for where in sources.values()
        if where.column is not None and where.entry.time is not None
    }
    times = {**held.times, **named}
    if "time_s" in sources:
        where = sources["time_s"]
        base = _converted("time_s", where, held.numeric[str(where.column)], actuator, source)
        clock = _times_of_format(str(where.column), wanted, held, base)
    else:
        leading = sources["command_rad"].column
        leading = leading if leading in times else next(name for name in wanted if name in times)
        base = clock = times[leading]
    numeric = dict(held.numeric)
    holding = {*states, *(where.column for name, where in sources.items() if name in HELD)}
    turning = sources.get("angle_rad", Source(OWN_NAME))
    bases: dict[int, list[str]] = {}
    for name in wanted:
        own, rows_at = times.get(name), base if name in named else clock
        if own is None or np.array_equal(own, rows_at):
            continue
        values = numeric[name]
        if name == turning.column:
            values = _without_turns(turning, values, actuator, source)
        numeric[name] = _moved(name, own, values, rows_at, actuator, source, holds=name in holding)
        bases.setdefault(own.size, []).append(name)
    notes += [
        f"{', '.join(names)}: brought from times of their own to those of the command"
        for names in bases.values()
    ]
    brought = {name: numeric[name] for names in bases.values() for name in names}
    rows, left_out = covered_rows(brought, base.size, source)
    notes += left_out
    texts = {name: _cut(values, rows, base.size) for name, values in held.texts.items()}
    numeric = {name: _cut(values, rows, base.size) for name, values in numeric.items()}
    return FileColumns(numeric, held.unusable, texts), base[rows]


def _times_of_format(time: str, wanted: Sequence[str], held: FileColumns, base: Array) -> Array:
    """Return the format's times (n,) [s] of the rows whose column `time` holds `base` (n,); else `base`.

    A column of times comes before what the format says, which may be a default only, and may count from
    another start: columns of other groups are brought to these rows by the format's times alone.
    """
    group = time.rpartition("/")[0]
    for name in (time, *wanted):
        own = held.times.get(name)
        if own is not None and own.size == base.size and name.rpartition("/")[0] == group:
            return own
    return base


def _cut(values: NDArray[Any], rows: slice, size: int) -> NDArray[Any]:
    return values[rows] if values.size == size else values


def _without_turns(angle: Source, raw: Array, actuator: Actuator, source: str) -> Array:
    """Return a raw column of an angle, in its own unit, without the jumps of a sensor that starts anew."""
    none, one = _converted("angle_rad", angle, np.array([0.0, 1.0]), actuator, source)
    return np.asarray(continuous((one - none) * raw) / (one - none))


def _times_in_file(
    entry: ChannelEntry, held: FileColumns, sources: Mapping[str, Source], actuator: Actuator, source: str
) -> Array:
    there = resolved(str(entry.time), list(held.numeric), source)
    if there is None:
        raise RecordingError(
            f"{source}: no column '{entry.time}', which [channels] in the actuator's TOML gives as time"
            f"{missing_name(str(entry.time), list(held.numeric))}; correct the name there"
        )
    unit = sources["time_s"] if "time_s" in sources else Source(ChannelEntry())
    return _converted("time_s", unit, held.numeric[there], actuator, source)


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
    """Return a column on the times `base` (n,) [s]; NaN in gaps that are longer than may be interpolated."""
    if times.shape != values.shape:
        raise RecordingError(
            f"{source}: column '{name}' has {values.size} rows, its times have {times.size}; give the "
            "times of this column"
        )
    if base.size < 2:
        raise RecordingError(f"{source}: too short: {base.size} rows; record a longer manoeuvre")
    known = np.isfinite(values) & np.isfinite(times)
    seen, steps = times[known], np.diff(times[known])
    if seen.size < (1 if holds else 2) or np.any(steps <= 0) or np.any(np.diff(base) <= 0):
        raise RecordingError(
            f"{source}: column '{name}' has times of its own, which do not increase; export it with the "
            "times of the command"
        )
    if holds:
        return last_state(seen, values[known], base)
    found = moved(*_between(times, values, known), base, actuator.channels.sampling)
    # Of a column that is written when it changes, a long step is no gap.
    usual = float(np.percentile(steps, 90))
    for i in np.flatnonzero(steps > (actuator.reading.longest_gap + 1.25) * usual):
        found[(base > seen[i] + 1e-6 * usual) & (base < seen[i + 1] - 1e-6 * usual)] = np.nan
    return found


def _between(times: Array, values: Array, known: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return times (m,) and values (m,) from the first `known` row (n,) to the last, empty ones on a curve.

    Without them, a mean would count for the rows after it too.
    """
    places = np.flatnonzero(known)
    rows = np.flatnonzero(np.isfinite(times))
    rows = rows[(rows >= places[0]) & (rows <= places[-1])]
    if rows.size == places.size or places.size < FEWEST_ROWS or np.any(np.diff(times[rows]) <= 0):
        return times[known], values[known]
    filled = curve(times[known], values[known], times[rows])
    return times[rows], np.where(known[rows], values[rows], filled)


def _converted(name: str, where: Source, raw: Array, actuator: Actuator, source: str) -> Array:
    entry = where.entry
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
        others = [f'"{one}"' for one in get_args(Coordinates) if _converts(entry.unit, name, one)]
        hint = f", or set coordinates = {' or '.join(others)}" if others else ""
        raise RecordingError(
            f"{source}: unit of {name} under [channels] in the actuator's TOML: {error}; correct the "
            f"unit{hint}"
        ) from None


def check_units(actuator: Actuator, names: Iterable[str], source: str) -> None:
    """Refuse a unit in the entries of the channels `names` that is one of another quantity.

    Raises
    ------
    RecordingError
        As `table_of` does where such an entry is applied.
    """
    for name in names:
        _converted(name, Source(actuator.channels.entry(name)), np.zeros(1), actuator, source)


def _converts(unit: str, name: str, coordinates: str) -> bool:
    """Return whether a `unit` is one of channel `name` in these coordinates."""
    from emaphm.actuator.columns.units import in_unit

    try:
        in_unit(np.zeros(1), unit, unit_for(SCHEMA[name].unit, coordinates))
    except ValueError:
        return False
    return True


def _derived(
    name: str,
    where: Source,
    held: FileColumns,
    channels: Mapping[str, Array],
    actuator: Actuator,
    source: str,
) -> Array:
    expression = Expression.parse(str(where.entry.derived))
    operands = operands_of(
        expression, {**held.texts, **held.numeric}, channels, source, f"{name} is derived from"
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
    return _converted(name, where, raw, actuator, source)


def operands_of(
    expression: Expression,
    columns: Mapping[str, NDArray[Any]],
    channels: Mapping[str, Array],
    source: str,
    what: str,
) -> dict[str, NDArray[Any]]:
    """Return the arrays (n,) that an expression names: columns of the file, else channels of the schema.

    Raises
    ------
    RecordingError
        There is none of a name, or they differ in length.
    """
    there = columns_of(expression, list(columns), source)
    operands = {}
    for name in expression.names:
        if name in there:
            operands[name] = columns[there[name]]
        elif name in channels:
            operands[name] = channels[name]
        else:
            raise RecordingError(
                f"{source}: no column '{name}', which {what} in the actuator's TOML"
                f"{missing_name(name, [*columns, *channels])}; correct the name there"
            )
    sizes = {values.size for values in operands.values()}
    if len(sizes) > 1:
        raise RecordingError(
            f"{source}: the columns of '{expression.text}' have {' and '.join(map(str, sorted(sizes)))} "
            "rows; give columns of the same length"
        )
    return operands
