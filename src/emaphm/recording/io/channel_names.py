"""From the names in a file to the names of the schema, through an actuator's `[channels]`."""

from emaphm.actuator.parameters import Channels
from emaphm.errors import RecordingError, nearest
from emaphm.recording.checks import NEEDED, missing_columns
from emaphm.recording.io.file_columns import FileColumns
from emaphm.recording.schema import SCHEMA


def names_in_file(columns: FileColumns, channels: Channels, source: str) -> dict[str, str]:
    """Return the name in the file of each schema column that it holds.

    A column is known by the name that `channels` gives it, else by its schema name. A file without
    any of the foreign names is read by schema names alone, so that what emaphm wrote for a rig can be
    read back with that rig's description.

    Parameters
    ----------
    columns
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
    held = [*columns.numeric, *columns.unusable]
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
        free = [name for name in held if name not in names.values()]
        raise RecordingError(f"{source}: {_missing(missing[0], given[missing[0]], free, held)}")
    for name, there in names.items():
        if there in columns.unusable:
            label = f"'{there}'" if there == name else f"'{there}' ({name})"
            raise RecordingError(f"{source}: column {label} {columns.unusable[there]}")
    return names


def _missing(name: str, there: str, free: list[str], held: list[str]) -> str:
    # A column that already is another channel is no candidate for the missing one.
    hint = nearest(there, free) if free else f" (the file has: {', '.join(held) or 'no column'})"
    if there != name:
        return (
            f"no column '{there}', which [channels] in the actuator's TOML gives for {name}{hint}; "
            "correct the name there, or take the line out"
        )
    return (
        f"no column '{name}'{hint}; if it has another name in the file, put {name} = \"that name\" under "
        f"[channels] in the actuator's TOML (a recording needs {NEEDED})"
    )
