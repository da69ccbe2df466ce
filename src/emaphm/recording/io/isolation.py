"""Reading in a process of its own: what crashes the Parquet or HDF5 library does not crash the caller."""

import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from emaphm.errors import RecordingError
from emaphm.input_files import checked_size
from emaphm.recording.io import foreign_columns
from emaphm.recording.io.file_columns import FileColumns, check_names, tidy
from emaphm.recording.io.limits import ReadLimits

FORMATS = {"parquet": "Parquet", "hdf5": ".mat"}

LONGEST_HEADER = 64 * 2**20
"""Longest list of columns and complaints that the process may answer with [bytes]."""


def isolated_columns(kind: str, path: Path, limits: ReadLimits) -> FileColumns:
    """Read a file by `emaphm.recording.io.foreign_columns`, in another process unless `limits` say otherwise.

    Parameters
    ----------
    kind
        "parquet" or "hdf5".
    path
        The file.
    limits
        Of the file and of the process.

    Raises
    ------
    RecordingError
        The file is larger than `limits`, is damaged, or its library fails on it.
    """
    source = str(path)
    checked_size(path, limits.file_bytes, RecordingError)
    try:
        if limits.isolated and sys.executable:
            answer = _answer(kind, path, limits, source)
        else:
            answer = foreign_columns.read(kind, str(path), limits.rows, limits.columns, limits.numbers)
    except foreign_columns.UnreadableError as error:
        raise _unreadable(kind, source, str(error)) from None
    rows, columns, names, unusable, arrays = answer
    limits.check(rows, columns, source)
    tidied = {name: tidy(name) for name in (*names, *unusable)}
    check_names([tidied[name] for name in names] + [tidied[name] for name in unusable], source)
    return FileColumns(
        {tidied[name]: values for name, values in zip(names, arrays, strict=True)},
        {tidied[name]: complaint for name, complaint in unusable.items()},
    )


def _answer(kind: str, path: Path, limits: ReadLimits, source: str) -> Any:
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
            command, stdin=subprocess.DEVNULL, capture_output=True, check=False, env=environment,
            timeout=limits.seconds,
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
    return answer["rows"], answer["columns"], answer["names"], answer["unusable"], arrays


def _unreadable(kind: str, source: str, why: str) -> RecordingError:
    again = "export" if kind == "parquet" else "save"
    return RecordingError(
        f"{source}: not a readable {FORMATS[kind]} file ({why}); it may be cut short: copy or {again} it "
        "again"
    )
