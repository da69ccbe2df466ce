"""Assignment of each schema channel to a column of a file, an expression of columns, or a number."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from emaphm.actuator.channels import OWN_NAME, ChannelEntry, Channels
from emaphm.actuator.columns.expression import Expression
from emaphm.errors import RecordingError, nearest
from emaphm.recording.checks import NEEDED, missing_columns
from emaphm.recording.io.file_columns import FileColumns
from emaphm.recording.schema import SCHEMA


@dataclass(frozen=True)
class Source:
    """Source of a channel: its `entry`, and its `column` in the file, None for a derived or given channel."""

    entry: ChannelEntry
    column: str | None = None

    @property
    def label(self) -> str:
        """Name of the source in an error."""
        return self.column or self.entry.derived or "value"


def sources_in_file(
    columns: FileColumns, channels: Channels, source: str, known: Collection[str] = ()
) -> tuple[dict[str, Source], bool]:
    """Return the source of each schema channel of a file, and whether emaphm itself wrote the file.

    The source of a channel is given by its entry, else it is the column with its schema name; a channel that
    the file lacks is left out. A foreign name is a name in an entry that is not a schema name. A file without
    any foreign name is read by schema names only and without conversion, so that a file that emaphm wrote for
    a rig can be read again with that rig's description. Reading refuses a file that lacks a channel with a
    foreign name, therefore a file written by emaphm contains all these channels. If one of them is in the
    file under neither name, and an entry converts or delays a column of the file, the file is taken as
    foreign and the foreign name is reported as missing. If the format has times of its own, `time_s` may be
    absent.

    Parameters
    ----------
    columns
        Columns of the file.
    channels
        The rig's entries.
    source
        The file's name, for errors.
    known
        Channels whose values are given otherwise: they are neither read nor required.

    Raises
    ------
    RecordingError
        A name set in `channels`, or a required column, is not in the file, is in several of its groups, or is
        not a column of numbers.
    """
    in_file = [*columns.numeric, *columns.unusable]
    entries = {name: channels.entry(name) for name in SCHEMA if name not in known}
    foreign = {name: entry for name, entry in entries.items() if _foreign_names(name, entry)}
    foreign_names = {column for name, entry in foreign.items() for column in _foreign_names(name, entry)}
    # A file that emaphm wrote has schema names and no groups; any other file must contain the entries'
    # columns.
    is_foreign = (
        "time_s" not in in_file
        or any(resolved(column, in_file, source) for column in sorted(foreign_names))
        or (any(name not in in_file for name in foreign) and bool(_changed_in_file(entries, in_file)))
    )
    sources: dict[str, Source] = {}
    for name, entry in entries.items():
        own = name if name in in_file and name not in foreign_names else None
        if name in foreign and is_foreign:
            column = resolved(entry.column, in_file, source) if entry.column is not None else None
            if column or entry.derived is not None:
                channel_source: Source | None = Source(entry, column)
            else:
                channel_source = _column_source(own, OWN_NAME)
        else:
            if name not in foreign and name not in foreign_names:
                own = resolved(name, in_file, source)
            applies = is_foreign or not foreign
            channel_source = _schema_source(entry, own, applies=applies, is_foreign=is_foreign)
        if channel_source is not None:
            sources[name] = channel_source
    _check_missing(sources, entries, is_foreign, columns, source, known)
    for name, used in sources.items():
        if used.column in columns.unusable:
            label = f"'{used.column}'" if used.column == name else f"'{used.column}' ({name})"
            raise RecordingError(f"{source}: column {label} {columns.unusable[used.column]}")
    return sources, bool(foreign) and not is_foreign


def _column_source(column: str | None, entry: ChannelEntry) -> Source | None:
    return None if column is None else Source(entry, column)


def _schema_source(entry: ChannelEntry, own: str | None, *, applies: bool, is_foreign: bool) -> Source | None:
    """Return the source of a channel whose entry has no foreign name.

    `own` is the column with its schema name; `applies` is whether the entries describe this file.
    """
    if entry.derived is not None and applies:
        return Source(entry)  # derived from schema channels only, which any file has
    if entry.value is not None and (is_foreign or not own):
        return Source(entry)
    return _column_source(own, entry if applies else OWN_NAME)


def resolved(name: str, in_file: Sequence[str], source: str) -> str | None:
    """Return the column of the file that `name` means: the same name, or the same name in a single group.

    Raises
    ------
    RecordingError
        Several groups have a column of that name.
    """
    if name in in_file:
        return name
    in_groups = [column for column in in_file if column.endswith(f"/{name}")]
    if len(in_groups) > 1:
        raise RecordingError(
            f"{source}: {len(in_groups)} columns are named '{name}' ({', '.join(in_groups[:5])}); write the "
            "group before it in [channels] of the actuator's TOML, as here"
        )
    return in_groups[0] if in_groups else None


def columns_of(expression: Expression, in_file: Sequence[str], source: str) -> Mapping[str, str]:
    """Return the column of each name in an expression that is a column of the file."""
    columns = {name: resolved(name, in_file, source) for name in expression.names}
    return {name: column for name, column in columns.items() if column}


def missing_name(missing: str, in_file: Sequence[str], free: Sequence[str] | None = None) -> str:
    """Return a hint on a name that is not among the columns `in_file`: the nearest name or the columns.

    Only the columns `free`, all of the file if omitted, are proposed.
    """
    groups = sorted({name.rpartition("/")[0] for name in in_file if "/" in name})
    group, slash, _ = missing.rpartition("/")
    if slash and groups and group not in groups:
        return f" (no group '{group}'{nearest(group, groups)})"
    free = in_file if free is None else free
    return nearest(missing, free) if free else f" (the file has: {', '.join(in_file) or 'no column'})"


def _foreign_names(name: str, entry: ChannelEntry) -> list[str]:
    """Return the names in the entry of channel `name` that are not schema names."""
    if entry.derived is not None:
        return [operand for operand in Expression.parse(entry.derived).names if operand not in SCHEMA]
    return [entry.column] if entry.column not in {None, name} else []


def _changed_in_file(entries: Mapping[str, ChannelEntry], in_file: Collection[str]) -> list[str]:
    """Return the channels in a file under their schema names whose entries change the values."""
    return [name for name, entry in entries.items() if name in in_file and _changes_values(name, entry)]


def _changes_values(name: str, entry: ChannelEntry) -> bool:
    """Return whether an entry converts, delays or derives from the column with the schema name `name`."""
    if entry.derived is not None:
        return name in Expression.parse(entry.derived).names
    return entry.column in {None, name} and entry.value is None and entry != ChannelEntry(column=entry.column)


def _check_missing(
    sources: Mapping[str, Source],
    entries: Mapping[str, ChannelEntry],
    is_foreign: bool,
    columns: FileColumns,
    source: str,
    known: Collection[str],
) -> None:
    """Raise the error of `sources_in_file` for the first missing channel, with the likely remedy."""
    in_file = [*columns.numeric, *columns.unusable]
    foreign = [name for name, entry in entries.items() if _foreign_names(name, entry)]
    missing = [name for name in foreign if is_foreign and name not in sources]
    has_times = bool(columns.times)
    missing += [name for name in missing_columns({*sources, *known}) if not (name == "time_s" and has_times)]
    if not missing:
        return
    name = missing[0]
    entry = entries[name]
    expected = entry.column or name
    # A column that is already the source of another channel is no candidate for the missing one.
    used = {channel_source.column for channel_source in sources.values()}
    hint = missing_name(expected, in_file, [column for column in in_file if column not in used])
    if expected != name:
        of_rig = any(channel in sources and sources[channel].entry is not OWN_NAME for channel in foreign)
        changed = [] if of_rig else _changed_in_file(entries, in_file)
        own = f"; if emaphm wrote the file, take out that of {' and '.join(changed)} too" if changed else ""
        raise RecordingError(
            f"{source}: no column '{expected}', which [channels] in the actuator's TOML gives for "
            f"{name}{hint}; correct the name there, or take the line out{own}"
        )
    raise RecordingError(
        f"{source}: no column '{name}'{hint}; if it has another name in the file, put {name} = \"that name\" "
        f'under [channels] in the actuator\'s TOML, or {{ column = "that name", unit = "its unit" }} where '
        f"that is another (a recording needs {NEEDED})"
    )
