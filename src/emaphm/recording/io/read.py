"""Reading recordings from a file, by its ending: its rows become one recording, or many."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator, Sampled
from emaphm.actuator.argument import check_actuator
from emaphm.actuator.channels import OWN_NAME
from emaphm.actuator.columns.expression import Expression
from emaphm.actuator.reading import Reading
from emaphm.errors import RecordingError, SignalError, nearest
from emaphm.input_files import checked_size
from emaphm.recording.checks import check
from emaphm.recording.conditioning.condition import conditioned
from emaphm.recording.conditioning.low_pass import low_passed
from emaphm.recording.conditioning.masks import kept_rows
from emaphm.recording.conditioning.table import Table, check_units, table_of
from emaphm.recording.equivalent_current import with_equivalent_current
from emaphm.recording.io.channel_names import Source, resolved, sources_in_file
from emaphm.recording.io.csv_file import read_csv
from emaphm.recording.io.file_columns import FileColumns
from emaphm.recording.io.limits import ReadLimits
from emaphm.recording.io.logger_files import read_hdf5, read_mdf, read_parquet, read_tdms
from emaphm.recording.io.mat_file import read_mat
from emaphm.recording.recording import Label, Recording
from emaphm.recording.schema import SCHEMA
from emaphm.recording.splitting import Cut, Piece, columns_in, cut, stretches

READERS: dict[str, Callable[[Path, ReadLimits, Collection[str]], FileColumns]] = {
    ".csv": read_csv,
    ".parquet": read_parquet,
    ".mat": read_mat,
    ".tdms": read_tdms,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".mf4": read_mdf,
}
"""How each kind of file is read; the endings in lower case. The last argument are the columns that are asked
for."""

Known = Mapping[str, Label]

NOTHING: Known = MappingProxyType({})

SERIAL = "serial"
"""Label under which the unit's serial number stands."""


def read_recording(
    path: str | Path,
    actuator: Actuator,
    *,
    known: Known = NOTHING,
    limits: ReadLimits = ReadLimits(),  # noqa: B008 - frozen
) -> Recording:
    """Read the one recording of `actuator` that a file holds.

    Columns are found, converted and derived as ``actuator.channels`` says, else by their schema names; rows
    are left out and cleaned as ``actuator.reading`` says, each with a note. Columns beyond the schema are
    kept if they have as many rows; those that are constant are labels too. Where `current_A` is absent it is
    made from the phase currents and `angle_rad` (`equivalent_current`, form "torque").

    Parameters
    ----------
    path
        A file with an ending of `READERS`; capitals do not matter.
    actuator
        Gives the channels, how they were sampled, what of the file is read, and the pole pairs.
    known
        What holds for the whole file: channels of the schema, in SI units, and labels such as "serial".
    limits
        Sizes beyond which a file is refused before it is read.

    Raises
    ------
    RecordingError
        The file is too large, cannot be read, lacks a column, holds several recordings, or breaks a rule of
        `emaphm.recording.checks.check`.
    ActuatorError
        `actuator` is no `Actuator`.
    """
    file = _opened(Path(path), actuator, known, limits)
    if file.reading.split is None:
        pieces = stretches(file.table, file.kept, file.table.rows) if not np.all(file.kept) else [file.whole]
        way = "the masks under [reading] leave"
    else:
        pieces = list(_cut(file, file.reading.split).pieces)
        way = f'split = "{file.reading.split}" makes'
    if len(pieces) != 1:
        raise RecordingError(
            f"{path}: {way} {len(pieces)} recordings of this file; read them with read_recordings, or cut "
            "it: emaphm split FILE"
        )
    return _recording(file, pieces[0])


def read_recordings(
    path: str | Path,
    actuator: Actuator,
    *,
    split: str | None = None,
    known: Known = NOTHING,
    on_refused: Callable[[str], None] | None = None,
    limits: ReadLimits = ReadLimits(),  # noqa: B008 - frozen
) -> list[Recording]:
    """Read all recordings of `actuator` that a file holds, in their order.

    Parameters
    ----------
    path, actuator, known, limits
        As for `read_recording`.
    split
        What the file is cut by (`emaphm.recording.splitting.cut`): names of columns with commas between,
        "period", "rests" or "stretches"; as ``actuator.reading.split`` says where left out, else one
        recording.
    on_refused
        Called with the reason for each piece that is no recording. Where left out, pieces that are too short
        are passed over, and any other reason is raised.

    Raises
    ------
    RecordingError
        As for `read_recording`; also if no piece is a recording.
    """
    return _every(_opened(Path(path), actuator, known, limits, split), split, on_refused)


def recordings_of(
    columns: FileColumns, source: str, actuator: Actuator, *, split: str | None = None, known: Known = NOTHING
) -> list[Recording]:
    """Return the recordings in columns that were not read from a file, as `read_recordings` would.

    `source` is what errors and results call them. The columns of names in `actuator.channels` are read as a
    file's are.
    """
    return _every(_table_in(columns, Path(source), actuator, known, split), split, None)


def _every(file: "_File", split: str | None, on_refused: Callable[[str], None] | None) -> list[Recording]:
    path = file.path
    by = split or file.reading.split
    if by is None and np.all(file.kept):
        return [_recording(file, file.whole)]
    found = _cut(file, by or "stretches")
    reasons = list(found.refused)
    recordings = []
    for piece in found.pieces:
        try:
            recordings.append(_recording(file, piece))
        except RecordingError as error:
            if on_refused is None:
                raise
            reasons.append(str(error))
    if not recordings:
        more = f" (and {len(reasons) - 1} more)" if len(reasons) > 1 else ""
        raise RecordingError(reasons[0] + more if reasons else f"{path}: no row is left; correct [reading]")
    for reason in reasons if on_refused else ():
        on_refused(reason)  # type: ignore[misc] # the loop is empty without it
    return recordings


@dataclass(frozen=True)
class _File:
    """A file's table, the rows of it that are used, and how they are read."""

    path: Path
    actuator: Actuator
    reading: Reading
    table: Table
    kept: NDArray[np.bool_]
    known: Known

    @property
    def whole(self) -> Piece:
        return Piece(0, self.table.rows)


def _opened(
    path: Path, actuator: Actuator, known: Known, limits: ReadLimits, split: str | None = None
) -> _File:
    check_actuator(actuator)
    _constants(known, str(path))  # refused before a large file is read
    return _table_in(_columns(path, limits, _asked_for(actuator, split)), path, actuator, known, split)


def _table_in(
    held: FileColumns, path: Path, actuator: Actuator, known: Known, split: str | None = None
) -> _File:
    source = str(path)
    constants = _constants(known, source)
    passed_by = {*constants, *actuator.reading.ignore}
    sources, is_own = sources_in_file(held, actuator.channels, source, passed_by)
    # What emaphm wrote for this rig has been cut and masked already, and lacks the columns to do it by.
    wanted = actuator.reading
    reading = Reading(longest_gap=wanted.longest_gap, outliers=wanted.outliers) if is_own else wanted
    every = [*held.numeric, *held.unusable]
    if is_own:  # a wrong unit is one also where it is passed over
        check_units(actuator, (name for name in SCHEMA if name not in passed_by), source)
    passed_over = _passed_over(actuator, reading, sources, constants) if is_own else []
    named = list(columns_in(split or reading.split or ""))
    named += Expression.parse(reading.keep).names if reading.keep else ()
    named += [reading.serial] if reading.serial else ()
    needed = [there for name in named if (there := resolved(name, every, source))]
    table = table_of(held, sources, actuator, source, needed=needed, known=constants)
    if passed_over:
        table.notes.append(
            "no column that [channels] names is in the file: read by the names of the schema, as what emaphm "
            f"has written, without {', '.join(passed_over)}"
        )
    return _File(path, actuator, reading, table, kept_rows(table, reading, source), known)


def _passed_over(
    actuator: Actuator, reading: Reading, sources: Mapping[str, Source], constants: Mapping[str, float]
) -> list[str]:
    """Return what the actuator's description says of a file, and one of emaphm's own is read without.

    By `reading` in place of the actuator's.
    """
    entries = {name: actuator.channels.entry(name) for name in SCHEMA if name not in constants}
    entries = {name: entry for name, entry in entries.items() if entry != OWN_NAME}
    return [
        *(name for name in entries if name not in sources),
        *(f"the entry of {name}" for name in entries if name in sources and sources[name].entry == OWN_NAME),
        *(["what [reading] asks for"] if actuator.reading != reading else []),
    ]


def _constants(known: Known, source: str) -> dict[str, float]:
    constants = {name: value for name, value in known.items() if name in SCHEMA}
    for name, value in constants.items():
        if name in {"time_s", "command_rad"} or isinstance(value, str) or not np.isfinite(value):
            raise RecordingError(
                f"{source}: {name} = {value} cannot hold for a whole recording; give a number"
            )
    return {name: float(value) for name, value in constants.items()}


def _cut(file: _File, by: str) -> Cut:
    return cut(file.table, file.kept, by, file.reading.longest_gap, str(file.path))


def _recording(file: _File, piece: Piece) -> Recording:
    """Return the recording that a piece of a file is."""
    actuator, table, rows = file.actuator, file.table, slice(piece.start, piece.stop)
    source = f"{file.path}: {piece.name}" if piece.name else str(file.path)
    channels = {name: values[rows] for name, values in table.channels.items()}
    further = {name: values[rows] for name, values in table.further.items()}
    labels = _labels(file, further) | dict(piece.labels)
    # Not the raw column of a channel, which a condition or a cut names.
    channels |= {
        name: values for name, values in further.items() if values.dtype.kind == "f" and name not in SCHEMA
    }
    names = {name: where.label for name, where in table.sources.items()}
    delays = {name: where.entry.delay_s for name, where in table.sources.items()}
    channels, notes = conditioned(
        channels, table.constants, delays, file.reading, actuator.channels.sampling, names, source
    )
    check(channels, source, names)
    recording = Recording(
        channels, actuator.channels.sampling, source, [*table.notes, *piece.notes, *notes], labels
    )
    if file.reading.low_pass_hz is not None:
        recording = low_passed(recording, file.reading.low_pass_hz, table.constants)
    return with_equivalent_current(recording, actuator)


def _labels(file: _File, further: Mapping[str, NDArray[Any]]) -> dict[str, Label]:
    """Return what holds for all rows: constant columns beyond the schema, and what is known."""
    found: dict[str, Label] = {}
    for name, values in further.items():
        first = values[0] if values.size else ""
        if values.size and np.all(values == first):
            found[name] = first if isinstance(first, str) else float(first)
    serial = file.reading.serial
    if serial is not None:
        there = resolved(serial, list(file.table.further), str(file.path))
        if there is None or there not in found:
            raise RecordingError(
                f"{file.path}: column '{serial}', the unit's serial number, is "
                + (
                    "not the same throughout; cut the file by it"
                    if there
                    else "not in the file; correct [reading]"
                )
            )
        found[SERIAL] = found[there]
    return found | {name: value for name, value in file.known.items() if name not in SCHEMA}


def read_signal(path: str | Path, name: str) -> Sampled:
    """Read one signal, such as a command to follow, from the columns `time_s` and `name` of a file.

    Raises
    ------
    RecordingError
        The file cannot be read, or lacks one of the two columns.
    SignalError
        The values are not finite or the times do not increase.
    """
    path = Path(path)
    held = _columns(path, ReadLimits(), ("time_s", name))
    for needed in ("time_s", name):
        if needed not in held.numeric:
            absent = f"is missing{nearest(needed, held.numeric)}; the file needs time_s and {name}"
            raise RecordingError(f"{path}: column '{needed}' {held.unusable.get(needed, absent)}")
    try:
        return Sampled(held.numeric["time_s"], held.numeric[name])
    except SignalError as error:
        raise SignalError(f"{path}: {error}") from None


def _asked_for(actuator: Actuator, split: str | None) -> set[str]:
    """Return every name of a column that the description, or a way to cut, may mean."""
    reading, names = actuator.reading, set(SCHEMA)
    for channel in SCHEMA:
        entry = actuator.channels.entry(channel)
        names |= {one for one in (entry.column, entry.time) if one is not None}
        names |= set(Expression.parse(entry.derived).names) if entry.derived is not None else set()
    names |= set(Expression.parse(reading.keep).names) if reading.keep is not None else set()
    names |= {reading.serial} if reading.serial is not None else set()
    return names | set(columns_in(split or reading.split or ""))


def _columns(path: Path, limits: ReadLimits, asked_for: Collection[str]) -> FileColumns:
    if not checked_size(path, limits.file_bytes, RecordingError):
        raise RecordingError(f"{path}: the file is empty; record or copy it again")
    read = READERS.get(path.suffix.lower())
    if read:
        return read(path, limits, asked_for)
    ending = f"unknown file ending '{path.suffix}'" if path.suffix else "the name has no ending"
    raise RecordingError(
        f"{path}: {ending}; a recording ends in {', '.join(READERS)}: convert or rename the file"
    )
