"""Which column of a file, arithmetic of columns, or number each channel of the schema is."""

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
    """Where a channel comes from: its `entry`, and its `column` in the file if it is one."""

    entry: ChannelEntry
    column: str | None = None

    @property
    def label(self) -> str:
        """What an error calls it."""
        return self.column or self.entry.derived or "value"


def sources_in_file(
    columns: FileColumns, channels: Channels, source: str, known: Collection[str] = ()
) -> tuple[dict[str, Source], bool]:
    """Return where each schema channel of a file comes from, and whether the file is one of emaphm's own.

    A channel is what its entry says, else the column that has its schema name; one that the file lacks is
    left out. A file without any of the foreign names is read by schema names alone and without conversion, so
    that what emaphm wrote for a rig can be read back with that rig's description. As reading refuses a file
    without a channel that has a foreign name, what emaphm writes has all of them: where one is in the file
    under neither name, an entry that converts or delays a column which is there is not passed over, and the
    foreign name is missed. Where the format has times of its own, `time_s` may be absent.

    Parameters
    ----------
    columns
        What the file holds.
    channels
        The rig's entries.
    source
        The file's name, for errors.
    known
        Channels that are given otherwise: neither looked for nor missing.

    Raises
    ------
    RecordingError
        A name set in `channels`, or a needed column, is not in the file; it is there in several groups, or
        without being a column of numbers.
    """
    held = [*columns.numeric, *columns.unusable]
    entries = {name: channels.entry(name) for name in SCHEMA if name not in known}
    foreign = {name: entry for name, entry in entries.items() if _foreign_names(name, entry)}
    taken = {there for name, entry in foreign.items() for there in _foreign_names(name, entry)}
    # What emaphm wrote has schema names and no groups; any other file must hold what the entries say.
    is_foreign = (
        "time_s" not in held
        or any(resolved(there, held, source) for there in sorted(taken))
        or (any(name not in held for name in foreign) and bool(_changed_in_file(entries, held)))
    )
    found: dict[str, Source] = {}
    for name, entry in entries.items():
        own = name if name in held and name not in taken else None
        if name in foreign and is_foreign:
            there = resolved(entry.column, held, source) if entry.column is not None else None
            where = Source(entry, there) if there or entry.derived is not None else _own(own, OWN_NAME)
        else:
            if name not in foreign and name not in taken:
                own = resolved(name, held, source)
            where = _plain(entry, own, applies=is_foreign or not foreign, is_foreign=is_foreign)
        if where is not None:
            found[name] = where
    _check_missing(found, entries, is_foreign, columns, source, known)
    for name, where in found.items():
        if where.column in columns.unusable:
            label = f"'{where.column}'" if where.column == name else f"'{where.column}' ({name})"
            raise RecordingError(f"{source}: column {label} {columns.unusable[where.column]}")
    return found, bool(foreign) and not is_foreign


def _own(column: str | None, entry: ChannelEntry) -> Source | None:
    return None if column is None else Source(entry, column)


def _plain(entry: ChannelEntry, own: str | None, *, applies: bool, is_foreign: bool) -> Source | None:
    """Return where a channel comes from whose entry names no column that only a file of the rig has.

    `own` is the column with its schema name; `applies` says whether the entries are about this file.
    """
    if entry.derived is not None and applies:
        return Source(entry)  # of channels alone, which every file has
    if entry.value is not None and (is_foreign or not own):
        return Source(entry)
    return _own(own, entry if applies else OWN_NAME)


def resolved(name: str, held: Sequence[str], source: str) -> str | None:
    """Return the column of the file that `name` means: that name, or in the one group that has it.

    Raises
    ------
    RecordingError
        Several groups have a column of that name.
    """
    if name in held:
        return name
    inside = [there for there in held if there.endswith(f"/{name}")]
    if len(inside) > 1:
        raise RecordingError(
            f"{source}: {len(inside)} columns are named '{name}' ({', '.join(inside[:5])}); write the group "
            "before it in [channels] of the actuator's TOML, as here"
        )
    return inside[0] if inside else None


def columns_of(expression: Expression, held: Sequence[str], source: str) -> Mapping[str, str]:
    """Return the column of each name in an expression that is one of the file's."""
    found = {name: resolved(name, held, source) for name in expression.names}
    return {name: there for name, there in found.items() if there}


def missing_name(there: str, held: Sequence[str], free: Sequence[str] | None = None) -> str:
    """Return what may be meant by a name that is not among the columns `held` of a file."""
    groups = sorted({name.rpartition("/")[0] for name in held if "/" in name})
    group, slash, _ = there.rpartition("/")
    if slash and groups and group not in groups:
        return f" (no group '{group}'{nearest(group, groups)})"
    free = held if free is None else free
    return nearest(there, free) if free else f" (the file has: {', '.join(held) or 'no column'})"


def _foreign_names(name: str, entry: ChannelEntry) -> list[str]:
    """Return the names in an entry that only a file of this rig has."""
    if entry.derived is not None:
        return [one for one in Expression.parse(entry.derived).names if one not in SCHEMA]
    return [entry.column] if entry.column not in {None, name} else []


def _changed_in_file(entries: Mapping[str, ChannelEntry], held: Collection[str]) -> list[str]:
    """Return the channels in a file under their schema names whose entries change what these columns say."""
    return [name for name, entry in entries.items() if name in held and _changes_own(name, entry)]


def _changes_own(name: str, entry: ChannelEntry) -> bool:
    if entry.derived is not None:
        return name in Expression.parse(entry.derived).names
    return entry.column in {None, name} and entry.value is None and entry != ChannelEntry(column=entry.column)


def _check_missing(
    found: Mapping[str, Source],
    entries: Mapping[str, ChannelEntry],
    is_foreign: bool,
    columns: FileColumns,
    source: str,
    known: Collection[str],
) -> None:
    held = [*columns.numeric, *columns.unusable]
    promised = [name for name, entry in entries.items() if _foreign_names(name, entry)]
    missing = [name for name in promised if is_foreign and name not in found]
    has_times = bool(columns.times)
    missing += [name for name in missing_columns({*found, *known}) if not (name == "time_s" and has_times)]
    if not missing:
        return
    name = missing[0]
    entry = entries[name]
    there = entry.column or name
    # A column that already is another channel is no candidate for the missing one.
    taken = {where.column for where in found.values()}
    hint = missing_name(there, held, [one for one in held if one not in taken])
    if there != name:
        of_rig = any(one in found and found[one].entry is not OWN_NAME for one in promised)
        changed = [] if of_rig else _changed_in_file(entries, held)
        own = f"; if emaphm wrote the file, take out that of {' and '.join(changed)} too" if changed else ""
        raise RecordingError(
            f"{source}: no column '{there}', which [channels] in the actuator's TOML gives for {name}{hint}; "
            f"correct the name there, or take the line out{own}"
        )
    raise RecordingError(
        f"{source}: no column '{name}'{hint}; if it has another name in the file, put {name} = \"that name\" "
        f'under [channels] in the actuator\'s TOML, or {{ column = "that name", unit = "its unit" }} where '
        f"that is another (a recording needs {NEEDED})"
    )
