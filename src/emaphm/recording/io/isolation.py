"""Reading in a process of its own: what crashes a format's library does not crash the caller."""

import json
import os
import sys
from collections.abc import Collection
from pathlib import Path

import numpy as np

from emaphm.errors import RecordingError
from emaphm.input_files import checked_size
from emaphm.recording.io import foreign_columns
from emaphm.recording.io.file_columns import FileColumns, check_names, tidy
from emaphm.recording.io.limits import ReadLimits

FORMATS = {"parquet": "Parquet", "hdf5": ".mat", "hdf5 groups": "HDF5", "tdms": "TDMS", "mdf": "MDF 4"}
"""The kinds of `foreign_columns.READERS`, as an error names them."""

LONGEST_HEADER = 64 * 2**20
"""Longest list of columns and complaints that the process may answer with [bytes]."""


def isolated_columns(kind: str, path: Path, limits: ReadLimits, wanted: Collection[str] = ()) -> FileColumns:
    """Read a file by `emaphm.recording.io.foreign_columns`, in another process unless `limits` say otherwise.

    Parameters
    ----------
    kind
        One of `FORMATS`.
    path
        The file.
    limits
        Of the file and of the process.
    wanted
        Names of the columns to read, where not all of a kind are.

    Raises
    ------
    RecordingError
        The file is larger than `limits`, is damaged, or its library fails on it.
    """
    source = str(path)
    checked_size(path, limits.file_bytes, RecordingError)
    try:
        if limits.isolated and sys.executable:
            held = _answer(kind, path, limits, wanted, source)
        else:
            most = foreign_columns.Most(limits.rows, limits.columns, limits.numbers)
            held = foreign_columns.read(kind, str(path), most, wanted)
    except foreign_columns.UnreadableError as error:
        raise _unreadable(kind, source, str(error)) from None
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


def _answer(
    kind: str, path: Path, limits: ReadLimits, wanted: Collection[str], source: str
) -> foreign_columns.Held:
    import subprocess

    command = [sys.executable, "-P", foreign_columns.__file__, kind, str(path.absolute())]
    command += map(str, (limits.rows, limits.columns, limits.numbers, limits.memory_bytes, limits.seconds))
    # What the process imports is what this one would; never what lies in the current folder.
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        "POLARS_MAX_THREADS": "2",
    }
    try:
        done = subprocess.run(  # noqa: S603 - this Python, on a file of this package
            command, input=json.dumps(sorted(wanted)).encode(), capture_output=True, check=False,
            env=environment, timeout=limits.seconds,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise _unreadable(kind, source, f"its library is still at it after {limits.seconds:g} s") from None
    except OSError as error:
        raise RecordingError(f"{source}: no process can be started to read it ({error.strerror})") from None
    header = done.stdout[:LONGEST_HEADER].partition(b"\n")[0]
    if done.returncode or not header:
        raise _unreadable(kind, source, "its library fails on it")
    answer = json.loads(header)
    if "error" in answer:
        raise foreign_columns.UnreadableError(answer["error"])
    arrays, position = [], len(header) + 1
    for length in answer["lengths"]:
        arrays.append(np.frombuffer(done.stdout, float, length, position))
        position += 8 * length
    return foreign_columns.Held(
        answer["rows"],
        answer["columns"],
        {name: arrays[place] for name, place in answer["numeric"].items()},
        answer["unusable"],
        {name: (distinct, arrays[place]) for name, (distinct, place) in answer["texts"].items()},
        {name: arrays[place] for name, place in answer["times"].items()},
    )


def _unreadable(kind: str, source: str, why: str) -> RecordingError:
    again = "export" if kind == "parquet" else "save"
    return RecordingError(
        f"{source}: not a readable {FORMATS[kind]} file ({why}); it may be cut short: copy or {again} it "
        "again"
    )
