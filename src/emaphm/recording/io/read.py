"""Reading a recording from a file: CSV, Parquet or MATLAB .mat, by the file's ending."""

from collections.abc import Callable
from pathlib import Path

from emaphm.actuator import Actuator, Sampled
from emaphm.errors import RecordingError, SignalError, nearest
from emaphm.input_files import checked_size
from emaphm.recording.checks import check
from emaphm.recording.equivalent_current import with_equivalent_current
from emaphm.recording.io.channel_names import names_in_file
from emaphm.recording.io.csv_file import read_csv
from emaphm.recording.io.file_columns import FileColumns
from emaphm.recording.io.limits import ReadLimits
from emaphm.recording.io.mat_file import read_mat
from emaphm.recording.io.parquet_file import read_parquet
from emaphm.recording.recording import Recording
from emaphm.recording.schema import SCHEMA

READERS: dict[str, Callable[[Path, ReadLimits], FileColumns]] = {
    ".csv": read_csv,
    ".parquet": read_parquet,
    ".mat": read_mat,
}
"""How each kind of file is read; the endings in lower case."""


def read_recording(
    path: str | Path,
    actuator: Actuator,
    *,
    limits: ReadLimits = ReadLimits(),  # noqa: B008 - frozen
) -> Recording:
    """Read a recording of `actuator` from a file.

    Columns are found by the names in ``actuator.channels``, else by their schema names. Columns of
    numbers beyond the schema are kept if they have as many rows. Where `current_A` is absent it is
    made from the phase currents and `angle_rad` (`equivalent_current`, form "torque").

    Parameters
    ----------
    path
        A .csv, .parquet or .mat file; capitals do not matter.
    actuator
        Gives the names of the channels, how they were sampled, and the pole pairs.
    limits
        Sizes beyond which a file is refused before it is read.

    Raises
    ------
    RecordingError
        The file is too large, cannot be read, lacks a column, or breaks a rule of
        `emaphm.recording.checks.check`.
    """
    path = Path(path)
    source = str(path)
    held = _columns(path, limits)
    names = names_in_file(held, actuator.channels, source)
    columns = {name: held.numeric[there] for name, there in names.items()}
    check(columns, source, names)
    taken = {*names.values(), *SCHEMA}
    for name, values in held.numeric.items():
        if name not in taken and values.shape == columns["time_s"].shape:
            columns[name] = values
    return with_equivalent_current(Recording(columns, actuator.channels.sampling, source), actuator)


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
    held = _columns(path, ReadLimits())
    for needed in ("time_s", name):
        if needed not in held.numeric:
            absent = f"is missing{nearest(needed, held.numeric)}; the file needs time_s and {name}"
            raise RecordingError(f"{path}: column '{needed}' {held.unusable.get(needed, absent)}")
    try:
        return Sampled(held.numeric["time_s"], held.numeric[name])
    except SignalError as error:
        raise SignalError(f"{path}: {error}") from None


def _columns(path: Path, limits: ReadLimits) -> FileColumns:
    if not checked_size(path, limits.file_bytes, RecordingError):
        raise RecordingError(f"{path}: the file is empty; record or copy it again")
    read = READERS.get(path.suffix.lower())
    if read:
        return read(path, limits)
    ending = f"unknown file ending '{path.suffix}'" if path.suffix else "the name has no ending"
    raise RecordingError(
        f"{path}: {ending}; a recording ends in {', '.join(READERS)}: convert or rename the file"
    )
