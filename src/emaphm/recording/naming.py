"""From the names in a file to the names of the schema, through an actuator's `[channels]`."""

from collections.abc import Mapping

from emaphm.actuator.parameters import Channels
from emaphm.errors import RecordingError, nearest
from emaphm.recording.checks import NEEDED, missing_columns
from emaphm.recording.schema import SCHEMA
from emaphm.recording.table import Table


def names_in_file(table: Table, channels: Channels, source: str) -> dict[str, str]:
    """Return the name in the file of each schema column that it holds.

    A column is known by the name that `channels` gives it, else by its schema name. A file without
    any of the foreign names is read by schema names alone, so that what emaphm wrote for a rig can be
    read back with that rig's description.

    Parameters
    ----------
    table
        What the file holds.
    channels
        Names under which the rig stores its channels.
    source
        The file's name, for errors.

    Raises
    ------
    RecordingError
        A name set in `channels`, or a needed column, is not in the file; or it is there without
        being a column of numbers.
    """
    held = [*table.numeric, *table.unusable]
    given: dict[str, str] = channels.model_dump(include=set(SCHEMA))
    foreign = {name: there for name, there in given.items() if there != name}
    is_foreign = any(there in held for there in foreign.values())
    names = {}
    for name in SCHEMA:
        if given[name] in held:
            names[name] = given[name]
        elif name in held and name not in foreign.values():
            names[name] = name
    missing = [name for name in foreign if is_foreign and name not in names]
    missing += missing_columns(names)
    if missing:
        free = [name for name in held if name not in names.values()] or held
        raise RecordingError(f"{source}: {_missing(missing[0], given, free)}")
    for name, there in names.items():
        if there in table.unusable:
            label = f"'{there}'" if there == name else f"'{there}' ({name})"
            raise RecordingError(f"{source}: column {label} {table.unusable[there]}")
    return names


def _missing(name: str, given: Mapping[str, str], free: list[str]) -> str:
    there = given[name]
    if not free:
        return f"there is no column at all; a recording needs {NEEDED}"
    if there != name:
        return (
            f"no column '{there}', which [channels] in the actuator's TOML gives for {name}"
            f"{nearest(there, free)}; correct the name there, or take the line out"
        )
    return (
        f"no column '{name}'{nearest(name, free)}; if it has another name in the file, put "
        f'{name} = "that name" under [channels] in the actuator\'s TOML (a recording needs {NEEDED})'
    )
