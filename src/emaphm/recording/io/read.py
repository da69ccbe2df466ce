"""Reading of one or several recordings from a file, whose ending determines the format."""

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
from emaphm.actuator.reading import ALWAYS_THERE, Reading
from emaphm.errors import RecordingError, SignalError, nearest
from emaphm.input_files import checked_size
from emaphm.recording.checks import FEWEST_SAMPLES, check, check_values
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
from emaphm.recording.splitting import Cut, Piece, columns_in, cut, label_of, stretches

READERS: dict[str, Callable[[Path, ReadLimits, Collection[str]], FileColumns]] = {
    ".csv": read_csv,
    ".parquet": read_parquet,
    ".mat": read_mat,
    ".tdms": read_tdms,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".mf4": read_mdf,
}
"""Reader of each kind of file by its ending in lower case. The last argument of a reader is the names of the
requested columns."""

Known = Mapping[str, Label]

NOTHING: Known = MappingProxyType({})

SERIAL = "serial"
"""Name of the label with the unit's serial number."""


def read_recording(
    path: str | Path,
    actuator: Actuator,
    *,
    known: Known = NOTHING,
    limits: ReadLimits = ReadLimits(),  # noqa: B008 - frozen
) -> Recording:
    """Read the single recording of `actuator` in a file.

    Columns are found, converted and derived according to ``actuator.channels``, else by their schema names.
    Rows are left out and cleaned according to ``actuator.reading``, each step with a note. Columns beyond the
    schema are kept if they have the same number of rows; constant columns are also labels. If `current_A` is
    absent, it is computed from the phase currents and `angle_rad` (`equivalent_current`, form "torque").

    Parameters
    ----------
    path
        A file with an ending of `READERS`, in upper or lower case.
    actuator
        Gives the channels, their sampling, the rows to read, and the pole pairs.
    known
        Given values for the whole file: channels of the schema, in SI units, and labels such as "serial".
    limits
        Sizes beyond which a file is refused before it is read.

    Raises
    ------
    RecordingError
        The file is too large, cannot be read, lacks a column, contains several recordings, or does not pass
        `emaphm.recording.checks.check`.
    ActuatorError
        `actuator` is no `Actuator`.
    """
    file = _opened(Path(path), actuator, known, limits)
    if file.reading.split is None:
        pieces = (
            stretches(file.table, file.kept, file.table.rows) if not np.all(file.kept) else [file.all_rows]
        )
        cause = "the masks under [reading] leave"
    else:
        pieces = list(_cut(file, file.reading.split).pieces)
        cause = f'split = "{file.reading.split}" makes'
    if not pieces:
        raise RecordingError(f"{path}: {_why_no_row_is_left(file)}")
    if len(pieces) != 1:
        raise RecordingError(
            f"{path}: {cause} {len(pieces)} recordings of this file; read them with read_recordings, or cut "
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
    """Read all recordings of `actuator` in a file, in their order.

    Parameters
    ----------
    path, actuator, known, limits
        As for `read_recording`.
    split
        Way to cut the file (`emaphm.recording.splitting.cut`): names of columns separated by commas,
        "period", "rests" or "stretches"; if omitted, ``actuator.reading.split``, and without that one
        recording.
    on_refused
        Called with the reason for each piece that is no recording. If omitted, pieces that are too short are
        skipped, and any other reason is raised.

    Raises
    ------
    RecordingError
        As for `read_recording`; also if no piece is a recording.
    """
    return _recordings(_opened(Path(path), actuator, known, limits, split), split, on_refused)


def recordings_of(
    columns: FileColumns, source: str, actuator: Actuator, *, split: str | None = None, known: Known = NOTHING
) -> list[Recording]:
    """Return the recordings in `columns` that were not read from a file, as `read_recordings` does.

    `source` is their name in errors and results. Columns named in `actuator.channels` are converted as those
    of a file.
    """
    return _recordings(_table_in(columns, Path(source), actuator, known, split), split, None)


def _recordings(
    file: "_File", split: str | None, on_refused: Callable[[str], None] | None
) -> list[Recording]:
    path = file.path
    by = split or file.reading.split
    if by is None and np.all(file.kept):
        return [_recording(file, file.all_rows)]
    pieces = _cut(file, by or "stretches")
    reasons = list(pieces.refused)
    recordings = []
    for piece in pieces.pieces:
        try:
            recordings.append(_recording(file, piece))
        except RecordingError as error:
            if on_refused is None:
                raise
            reasons.append(str(error))
    if not recordings:
        _check_times(file)
        more = f" (and {len(reasons) - 1} more)" if len(reasons) > 1 else ""
        raise RecordingError(reasons[0] + more if reasons else f"{path}: {_why_no_row_is_left(file)}")
    for reason in reasons if on_refused else ():
        on_refused(reason)  # type: ignore[misc] # the loop is empty without it
    return recordings


@dataclass(frozen=True)
class _File:
    """A file's table, the rows that are used, and the settings for reading them."""

    path: Path
    actuator: Actuator
    reading: Reading
    table: Table
    kept: NDArray[np.bool_]
    known: Known

    @property
    def all_rows(self) -> Piece:
        return Piece(0, self.table.rows)


def _opened(
    path: Path, actuator: Actuator, known: Known, limits: ReadLimits, split: str | None = None
) -> _File:
    check_actuator(actuator)
    _constants(known, str(path))  # refused before a large file is read
    return _table_in(
        _columns(path, limits, _requested_columns(actuator, split)), path, actuator, known, split
    )


def _table_in(
    columns: FileColumns, path: Path, actuator: Actuator, known: Known, split: str | None = None
) -> _File:
    source = str(path)
    constants = _constants(known, source)
    not_read = {*constants, *actuator.reading.ignore}
    sources, is_own = sources_in_file(columns, actuator.channels, source, not_read)
    # A file that emaphm wrote for this rig is already cut and masked, and lacks the columns for doing so
    # again.
    described = actuator.reading
    reading = Reading(longest_gap=described.longest_gap, outliers=described.outliers) if is_own else described
    in_file = [*columns.numeric, *columns.unusable]
    if is_own:  # a wrong unit is refused even if its entry is not applied
        check_units(actuator, (name for name in SCHEMA if name not in not_read), source)
    not_applied = _not_applied(actuator, reading, sources, constants) if is_own else []
    named = list(columns_in(split or reading.split or ""))
    named += Expression.parse(reading.keep).names if reading.keep else ()
    named += [reading.serial] if reading.serial else ()
    needed = [column for name in named if (column := resolved(name, in_file, source))]
    table = table_of(columns, sources, actuator, source, needed=needed, known=constants)
    if not_applied:
        table.notes.append(
            "no column that [channels] names is in the file: read by the names of the schema, as what emaphm "
            f"has written, without {', '.join(not_applied)}"
        )
    return _File(path, actuator, reading, table, kept_rows(table, reading, source), known)


def _not_applied(
    actuator: Actuator, reading: Reading, sources: Mapping[str, Source], constants: Mapping[str, float]
) -> list[str]:
    """Return the parts of the description that are not applied to a file that emaphm wrote, for a note.

    `reading` contains the settings that are applied in place of `actuator.reading`.
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


def _check_times(file: _File) -> None:
    """Raise `RecordingError` if the times of a file increase over too few rows for any recording."""
    time = file.table.channels["time_s"]
    if np.count_nonzero(time[1:] <= time[:-1]) * FEWEST_SAMPLES >= time.size:
        check_values({"time_s": time}, str(file.path), {"time_s": file.table.sources["time_s"].label})


def _why_no_row_is_left(file: _File) -> str:
    """Return the reason why no piece of a file is left, in words that continue "FILE: …"."""
    if not file.table.rows:
        return "too short: it has a header and no rows; record or copy it again"
    empty = [name for name, values in file.table.channels.items() if not np.any(~np.isnan(values[file.kept]))]
    if empty:
        label = file.table.sources[empty[0]].label if empty[0] in file.table.sources else empty[0]
        remedy = "" if empty[0] in ALWAYS_THERE else ", or leave it out (ignore under [reading])"
        return f"column '{label}' is empty in all rows that are used; correct it{remedy}"
    return (
        f"no row is left: each row that is used lies in a gap of more than {file.reading.longest_gap} rows "
        "in some channel; correct [reading], or leave a channel out (ignore)"
    )


def _cut(file: _File, by: str) -> Cut:
    return cut(file.table, file.kept, by, file.reading.longest_gap, str(file.path))


def _recording(file: _File, piece: Piece) -> Recording:
    """Return the conditioned recording from a piece of a file."""
    actuator, table, rows = file.actuator, file.table, slice(piece.start, piece.stop)
    source = f"{file.path}: {piece.name}" if piece.name else str(file.path)
    channels = {name: values[rows] for name, values in table.channels.items()}
    further = {name: values[rows] for name, values in table.further.items()}
    labels = _labels(file, further) | dict(piece.labels)
    # The raw column of a channel, which a condition or a cut may name, is not added again.
    channels |= {
        name: values for name, values in further.items() if values.dtype.kind == "f" and name not in SCHEMA
    }
    names = {name: channel_source.label for name, channel_source in table.sources.items()}
    delays = {name: channel_source.entry.delay_s for name, channel_source in table.sources.items()}
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
    """Return the labels of all rows: constant columns beyond the schema, and the given labels."""
    labels: dict[str, Label] = {}
    for name, values in further.items():
        first = values[0] if values.size else ""
        if values.size and np.all(values == first):
            labels[name] = label_of(first)
    serial = file.reading.serial
    if serial is not None:
        column = resolved(serial, list(file.table.further), str(file.path))
        if column is None or column not in labels:
            raise RecordingError(
                f"{file.path}: column '{serial}', the unit's serial number, is "
                + (
                    "not the same throughout; cut the file by it"
                    if column
                    else "not in the file; correct [reading]"
                )
            )
        labels[SERIAL] = labels[column]
    return labels | {name: value for name, value in file.known.items() if name not in SCHEMA}


def read_signal(path: str | Path, name: str) -> Sampled:
    """Read a signal, such as a command to simulate, from the columns `time_s` and `name` of a file.

    Raises
    ------
    RecordingError
        The file cannot be read, or lacks one of the two columns.
    SignalError
        The values are not finite or the times do not increase.
    """
    path = Path(path)
    columns = _columns(path, ReadLimits(), ("time_s", name))
    for needed in ("time_s", name):
        if needed not in columns.numeric:
            absent = f"is missing{nearest(needed, columns.numeric)}; the file needs time_s and {name}"
            raise RecordingError(f"{path}: column '{needed}' {columns.unusable.get(needed, absent)}")
    try:
        return Sampled(columns.numeric["time_s"], columns.numeric[name])
    except SignalError as error:
        raise SignalError(f"{path}: {error}") from None


def _requested_columns(actuator: Actuator, split: str | None) -> set[str]:
    """Return all names of columns in the description and in the way to cut, with the schema names."""
    reading, names = actuator.reading, set(SCHEMA)
    for channel in SCHEMA:
        entry = actuator.channels.entry(channel)
        names |= {name for name in (entry.column, entry.time) if name is not None}
        names |= set(Expression.parse(entry.derived).names) if entry.derived is not None else set()
    names |= set(Expression.parse(reading.keep).names) if reading.keep is not None else set()
    names |= {reading.serial} if reading.serial is not None else set()
    return names | set(columns_in(split or reading.split or ""))


def _columns(path: Path, limits: ReadLimits, requested: Collection[str]) -> FileColumns:
    if not checked_size(path, limits.file_bytes, RecordingError):
        raise RecordingError(f"{path}: the file is empty; record or copy it again")
    read = READERS.get(path.suffix.lower())
    if read:
        return read(path, limits, requested)
    ending = f"unknown file ending '{path.suffix}'" if path.suffix else "the name has no ending"
    raise RecordingError(
        f"{path}: {ending}; a recording ends in {', '.join(READERS)}: convert or rename the file"
    )
