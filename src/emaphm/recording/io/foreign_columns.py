"""Columns of Parquet and MATLAB 7.3 files, whose libraries can crash on damaged ones.

Runs as a process of its own (`emaphm.recording.io.isolation`), and imports nothing of emaphm to start fast.
It answers on stdout with one line of JSON, then the columns' numbers as bytes.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

TEXT_CLASS = "char"
"""MATLAB stores text as numbers; only the attribute MATLAB_class of the variable says so."""


class UnreadableError(Exception):
    """The file cannot be read; the text says why, in one line."""


Columns = tuple[int, int, list[str], dict[str, str], list[Any]]
"""Rows, columns, names of the numeric columns, complaints about the others by name, and the numeric arrays.

Where rows or columns are more than was asked for, nothing is read, and the last three are empty.
"""


def read(kind: str, path: str, most_rows: int, most_columns: int, most_numbers: int) -> Columns:
    """Return the columns of a file of `kind` "parquet" or "hdf5".

    Raises
    ------
    UnreadableError
        The library refuses the file.
    """
    reader = {"parquet": _parquet, "hdf5": _hdf5}[kind]
    try:
        return reader(path, most_rows, most_columns, most_numbers)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - libraries fail in any way on foreign bytes; polars panics
        lines = str(error).strip().splitlines() or [type(error).__name__]
        raise UnreadableError(lines[0].rstrip(".")) from None


def _parquet(path: str, most_rows: int, most_columns: int, most_numbers: int) -> Columns:
    import polars as pl

    # As a file object: in a path polars expands * and [].
    with Path(path).open("rb") as file:
        names = list(pl.read_parquet_schema(file))
        file.seek(0)
        rows = int(pl.scan_parquet(file).select(pl.len()).collect().item())
        if rows > most_rows or len(names) > most_columns or rows * len(names) > most_numbers:
            return rows, len(names), [], {}, []
        file.seek(0)
        frame = pl.read_parquet(file)
    numeric, unusable = {}, {}
    for column in frame.get_columns():
        if column.dtype.is_numeric():
            numeric[column.name] = np.asarray(column.cast(float).to_numpy(), float)
            continue
        first = repr(column[0]) if len(column) else "nothing"
        shown = first if len(first) <= 30 else f"{first[:27]}..."
        unusable[column.name] = (
            f"is of type {column.dtype} (row 1: {shown}), not numeric; store it as numbers in its SI unit"
        )
    return rows, len(names), list(numeric), unusable, list(numeric.values())


def _hdf5(path: str, most_rows: int, most_columns: int, most_numbers: int) -> Columns:
    import h5py

    numeric: dict[str, Any] = {}
    unusable: dict[str, str] = {}
    with h5py.File(path, "r") as file:
        names = [name for name in file if not name.startswith("#")]  # MATLAB's own
        if len(names) > most_columns:
            return 0, len(names), [], {}, []
        for name in names:
            if not isinstance(file.get(name, getlink=True), h5py.HardLink):
                unusable[name] = "is a link to elsewhere; save it as a vector of numbers under this name"
                continue
            item = file[name]
            complaint = _complaint(item)
            if complaint:
                unusable[name] = complaint
                continue
            if item.size > most_rows or item.size * (len(numeric) + 1) > most_numbers:
                return item.size, len(numeric) + 1, [], {}, []
            if item.id.get_storage_size() == 0:
                unusable[name] = "has no values in the file; save it again"
                continue
            numeric[name] = np.asarray(item[()], float).ravel()
    rows = max((values.size for values in numeric.values()), default=0)
    return rows, len(names), list(numeric), unusable, list(numeric.values())


def _complaint(item: Any) -> str | None:
    what = item.attrs.get("MATLAB_class", "")
    what = what.decode(errors="replace") if isinstance(what, bytes) else str(what)
    if not hasattr(item, "shape") or what == TEXT_CLASS or item.dtype.kind not in "fiu":
        kind = "a struct" if what == "struct" else "not numeric"
        return f"is {kind}; save it as a vector of real numbers under this name"
    if item.is_virtual or item.external:
        return "has its values in another file; save it as a vector of numbers under this name"
    return shape_complaint(item.shape or (0,))


def shape_complaint(shape: tuple[int, ...]) -> str | None:
    """Return why an array of this shape is no column, in words that continue "column 'x' …"."""
    size = math.prod(shape)
    if size == 1:
        return "is a single number; save one value for each sample"
    if size == 0 or size != max(shape):
        return f"is an array of {' × '.join(map(str, shape))}; save it as a vector, one value for each sample"
    return None


def _guard(memory_bytes: int, seconds: float) -> None:
    """Limit this process's memory [bytes] and time [s], where the system can."""
    try:
        import resource
    except ImportError:  # not on Windows
        return
    for kind, most in ((resource.RLIMIT_AS, memory_bytes), (resource.RLIMIT_CPU, int(seconds) + 1)):
        hard = resource.getrlimit(kind)[1]
        soft = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (soft, hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))


def main() -> None:
    """Answer on stdout."""
    kind, path, rows, columns, numbers, memory_bytes, seconds = sys.argv[1:]
    _guard(int(memory_bytes), float(seconds))
    try:
        found = read(kind, path, int(rows), int(columns), int(numbers))
    except UnreadableError as error:
        sys.stdout.write(json.dumps({"error": str(error)}) + "\n")
        return
    count, width, names, unusable, arrays = found
    lengths = [values.size for values in arrays]
    header = {"rows": count, "columns": width, "names": names, "unusable": unusable, "lengths": lengths}
    sys.stdout.write(json.dumps(header) + "\n")
    sys.stdout.flush()
    for values in arrays:
        sys.stdout.buffer.write(np.ascontiguousarray(values, float).tobytes())


if __name__ == "__main__":
    main()
