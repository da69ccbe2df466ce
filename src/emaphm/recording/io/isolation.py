"""Reading in a separate process, so that a crash of a format's library does not crash the caller."""

import sys
from collections.abc import Collection
from pathlib import Path

import numpy as np

from emaphm.errors import RecordingError
from emaphm.input_files import checked_size
from emaphm.recording.io import foreign_columns
from emaphm.recording.io.file_columns import FileColumns, check_names, tidy
from emaphm.recording.io.limits import ReadLimits
from emaphm.recording.io.reader_process import ReaderEndedError, ReaderTookTooLongError, read_by_process

FORMATS = {"parquet": "Parquet", "hdf5": ".mat", "hdf5 groups": "HDF5", "tdms": "TDMS", "mdf": "MDF 4"}
"""Names in errors of the kinds in `foreign_columns.READERS`."""


def isolated_columns(kind: str, path: Path, limits: ReadLimits, wanted: Collection[str] = ()) -> FileColumns:
    """Read a file by `emaphm.recording.io.foreign_columns`, in another process if `limits.isolated`.

    Parameters
    ----------
    kind
        One of `FORMATS`.
    path
        The file.
    limits
        Limits of the file and of the process.
    wanted
        Names of the columns to read, for kinds that are not read completely.

    Raises
    ------
    RecordingError
        The file is larger than `limits`, is damaged, or its library fails on it.
    """
    source = str(path)
    checked_size(path, limits.file_bytes, RecordingError)
    try:
        if limits.isolated and sys.executable:
            held = read_by_process(kind, path, limits, wanted)
        else:
            most = foreign_columns.Most(limits.rows, limits.columns, limits.numbers)
            held = foreign_columns.read(kind, str(path), most, wanted)
    except foreign_columns.UnreadableError as error:
        raise _unreadable(kind, source, str(error)) from None
    except ReaderEndedError:
        raise _unreadable(kind, source, "its library fails on it") from None
    except ReaderTookTooLongError:
        reason = f"its library has not finished after {limits.seconds:g} s"
        raise _unreadable(kind, source, reason) from None
    except OSError as error:
        raise RecordingError(
            f"{source}: no process can be started to read it ({error.strerror}); end other programs, or free "
            "memory, and try again"
        ) from None
    limits.check(held.rows, held.columns, source)
    check_names([tidy(name) for name in (*held.numeric, *held.unusable)], source)
    return FileColumns(
        {tidy(name): values for name, values in held.numeric.items()},
        {tidy(name): complaint for name, complaint in held.unusable.items()},
        {
            tidy(name): np.array(distinct, object)[numbers.astype(int)]
            for name, (distinct, numbers) in held.texts.items()
        },
        {tidy(name): values for name, values in held.times.items()},
    )


def _unreadable(kind: str, source: str, reason: str) -> RecordingError:
    again = "export" if kind == "parquet" else "save"
    return RecordingError(
        f"{source}: not a readable {FORMATS[kind]} file ({reason}); it may be cut short: copy or {again} it "
        "again"
    )
