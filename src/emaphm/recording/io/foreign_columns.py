"""Readers of Parquet, HDF5, TDMS and MDF files, whose libraries can crash on damaged files.

The module runs as a separate process (`emaphm.recording.io.reader_process`), and imports nothing of emaphm,
so that it starts fast. For each file it writes one line of JSON to stdout, then the columns' numbers as
bytes.
"""

import json
import math
import os
import sys
import time
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

TEXT_CLASS = "char"
"""MATLAB stores text as numbers; only the attribute MATLAB_class of the variable distinguishes text."""

NUMBERS = "fiub"
"""Kinds of NumPy's types that are read as numbers; true and false are read as 1 and 0."""


class UnreadableError(Exception):
    """The file cannot be read; the text gives the reason in one line."""


@dataclass
class Held:
    """Contents of a file.

    `rows` of the longest column and number of `columns`; `numeric`: arrays (n,) by name; `unusable`:
    complaints about the other columns by name; `texts`: for columns of texts, the distinct texts and the
    index of each row's text (n,); `times`: times (n,) [s] of the numeric columns with a separate time base.
    If rows or columns exceed the limits, nothing else is read.
    """

    rows: int = 0
    columns: int = 0
    numeric: dict[str, Any] = field(default_factory=dict)
    unusable: dict[str, str] = field(default_factory=dict)
    texts: dict[str, tuple[list[str], Any]] = field(default_factory=dict)
    times: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Most:
    """Largest numbers of rows, columns, and values in total that are read [-]."""

    rows: int
    columns: int
    numbers: int

    def exceeded(self, rows: int, columns: int) -> bool:
        """Return whether a file of `rows` and `columns` exceeds one of the limits."""
        return rows > self.rows or columns > self.columns or rows * columns > self.numbers


def read(kind: str, path: str, most: Most, wanted: Collection[str] = ()) -> Held:
    """Return the columns of a file of one of the kinds in `READERS`.

    Columns in groups are named "group/name". From "mdf" files only the columns `wanted` are read, given by
    name or "group/name".

    Raises
    ------
    UnreadableError
        The library refuses the file.
    """
    try:
        return READERS[kind](path, most, wanted)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - libraries fail in any way on foreign bytes; polars panics
        lines = str(error).strip().splitlines() or [type(error).__name__]
        raise UnreadableError(lines[0].rstrip(".")) from None


def _parquet(path: str, most: Most, _: Collection[str]) -> Held:
    import polars as pl

    # As a file object, because polars expands * and [] in a path.
    with Path(path).open("rb") as file:
        names = list(pl.read_parquet_schema(file))
        file.seek(0)
        held = Held(int(pl.scan_parquet(file).select(pl.len()).collect().item()), len(names))
        if most.exceeded(held.rows, held.columns):
            return held
        file.seek(0)
        frame = pl.read_parquet(file)
    for column in frame.get_columns():
        if column.dtype.is_numeric() or column.dtype == pl.Boolean:
            held.numeric[column.name] = np.asarray(column.cast(float).to_numpy(), float)
            continue
        first = repr(column[0]) if len(column) else "nothing"
        excerpt = first if len(first) <= 30 else f"{first[:27]}..."
        held.unusable[column.name] = (
            f"is of type {column.dtype} (row 1: {excerpt}), not numeric; store it as numbers in its SI unit"
        )
        if isinstance(column.dtype, (pl.String, pl.Categorical, pl.Enum)):
            _add_text(held, column.name, column.cast(pl.String).fill_null("").to_numpy())
    return held


def _hdf5(path: str, most: Most, _: Collection[str]) -> Held:
    """Read a MATLAB 7.3 file: the variables at the top level, without MATLAB's internal ones."""
    return _hdf5_file(path, most, deep=False)


def _hdf5_groups(path: str, most: Most, _: Collection[str]) -> Held:
    """Read any HDF5 file: data sets in all its groups."""
    return _hdf5_file(path, most, deep=True)


def _hdf5_file(path: str, most: Most, *, deep: bool) -> Held:
    import h5py

    held = Held()
    with h5py.File(path, "r") as file:
        items = [(name, file) for name in file if not name.startswith("#")]  # MATLAB's internal groups
        visited = {file.id}
        while items:
            if len(items) + held.columns > most.columns:
                held.columns += len(items)
                return held
            name, folder = items.pop(0)
            key = f"{folder.name.strip('/')}/{name}".strip("/")
            if not isinstance(folder.get(name, getlink=True), h5py.HardLink):
                held.unusable[key] = "is a link to elsewhere; save it as a vector of numbers under this name"
                continue
            item = folder[name]
            if deep and isinstance(item, h5py.Group):
                if item.id not in visited:
                    visited.add(item.id)
                    items += [(below, item) for below in item]
                continue
            held.columns += 1
            if not _add_data_set(held, key, item, most, deep=deep):
                return held
    return held


def _add_data_set(held: Held, key: str, item: Any, most: Most, *, deep: bool) -> bool:
    """Add a data set, or each field of a table, to `held`; return whether the limits `most` are kept."""
    dtype = getattr(item, "dtype", None)
    if deep and dtype is not None and dtype.names:
        fields = {f"{key}/{part}": (dtype[part], part) for part in dtype.names}
    else:
        fields = {key: (dtype, None)}
    for name, (field_dtype, part) in fields.items():
        complaint = _complaint(item, field_dtype)
        if complaint is None:
            held.rows = max(held.rows, item.size)
            if most.exceeded(held.rows, len(held.numeric) + 1):
                return False
            if item.id.get_storage_size() == 0:
                complaint = "has no values in the file; save it again"
        if complaint:
            held.unusable[name] = complaint
        else:
            held.numeric[name] = np.asarray(item[part] if part else item[()], float).ravel()
    return True


NO_START = np.datetime64("1904-01-01T00:00:00")
"""Origin of LabVIEW's times, which it writes as the start of a waveform whose start is unknown."""


def _tdms(path: str, most: Most, _: Collection[str]) -> Held:
    from nptdms import TdmsFile

    held = Held()
    with TdmsFile.open(path) as file:
        channels = {
            f"{group.name}/{channel.name}": channel for group in file.groups() for channel in group.channels()
        }
        held.rows, held.columns = max(map(len, channels.values()), default=0), len(channels)
        if most.exceeded(held.rows, held.columns):
            return held
        starts = {
            name: np.datetime64(channel.properties.get("wf_start_time")) for name, channel in channels.items()
        }
        starts = {name: start for name, start in starts.items() if not np.isnat(start) and start != NO_START}
        first = min(starts.values(), default=NO_START)
        stamps: dict[str, Any] = {}
        for name, channel in channels.items():
            kind = getattr(channel.dtype, "kind", "O")
            if kind == "M":
                stamps[name] = np.asarray(channel[:])
            elif kind not in NUMBERS:
                held.unusable[name] = "is not numeric; store it as numbers"
                if kind in "OSU":
                    _add_text(held, name, np.asarray([str(value) for value in channel[:]], object))
            else:
                held.numeric[name] = np.asarray(channel[:], float)
                increment = float(channel.properties.get("wf_increment", 0.0) or 0.0)
                if increment > 0:
                    start = float((starts.get(name, first) - first) / np.timedelta64(1, "s"))
                    start += float(channel.properties.get("wf_start_offset", 0.0) or 0.0)
                    held.times[name] = start + increment * np.arange(len(channel))
        begin = min((values.min() for values in stamps.values() if values.size), default=None)
        for name, values in stamps.items():
            held.numeric[name] = (values - begin) / np.timedelta64(1, "s")
    return held


def _mdf(path: str, most: Most, wanted: Collection[str]) -> Held:
    from asammdf import MDF

    held = Held()
    with MDF(path) as file:
        labels = _group_labels(file)
        for name, places in file.channels_db.items():
            keys = [f"{labels[group]}/{name}" for group, _ in places]
            for key, (group, index) in zip(keys, places, strict=True):
                if file.masters_db.get(group) == index:
                    continue
                if name not in wanted and key not in wanted:
                    if len(held.unusable) < MOST_NAMED:
                        held.unusable.setdefault(key, "was not asked for")
                    continue
                held.columns += 1
                held.rows = max(held.rows, file.groups[group].channel_group.cycles_nr)
                if keys.count(key) > 1:
                    held.unusable[key] = f"is there {keys.count(key)} times in its group; rename all but one"
                    continue
                if most.exceeded(held.rows, held.columns):
                    return held
                _add_signal(held, key, file.get(group=group, index=index).validate(copy=False))
    return held


MOST_NAMED = 1000
"""Most columns that are listed without being read, to propose the nearest name for a mistyped one; a bus log
has thousands of columns."""


def _group_labels(file: Any) -> list[str]:
    """Return the labels of the groups of an MDF file: their names if unique, else their numbers."""
    names = [str(group.channel_group.acq_name or "") for group in file.groups]
    return [name if name and names.count(name) == 1 else str(i) for i, name in enumerate(names)]


def _add_signal(held: Held, key: str, signal: Any) -> None:
    values = np.asarray(signal.samples)
    if values.ndim == 1 and values.dtype.kind in NUMBERS:
        held.numeric[key] = values.astype(float)
        held.times[key] = np.asarray(signal.timestamps, float)
        return
    held.unusable[key] = "is not numeric; export it as a channel of real numbers"
    if values.ndim == 1 and values.dtype.kind in "SU":
        texts = [
            value.decode(errors="replace") if isinstance(value, bytes) else str(value) for value in values
        ]
        _add_text(held, key, np.asarray(texts, object))


def _add_text(held: Held, name: str, values: Any) -> None:
    distinct, numbers = np.unique(values.astype(str), return_inverse=True)
    if distinct.size <= MOST_TEXTS:
        held.texts[name] = (distinct.tolist(), numbers.astype(float))


MOST_TEXTS = 10_000
"""Most distinct texts of a column that names runs, units or states; a column of remarks has more."""

READERS = {
    "parquet": _parquet, "hdf5": _hdf5, "hdf5 groups": _hdf5_groups, "tdms": _tdms, "mdf": _mdf
}  # fmt: skip
"""Reader of each kind of file."""


def _complaint(item: Any, dtype: Any) -> str | None:
    """Return why a data set of type `dtype` is no column of numbers, None if it is one."""
    matlab_class = item.attrs.get("MATLAB_class", "")
    matlab_class = (
        matlab_class.decode(errors="replace") if isinstance(matlab_class, bytes) else str(matlab_class)
    )
    if not hasattr(item, "shape") or matlab_class == TEXT_CLASS or dtype.kind not in NUMBERS:
        kind = "a struct" if matlab_class == "struct" else "not numeric"
        return f"is {kind}; save it as a vector of real numbers under this name"
    if item.is_virtual or item.external:
        return "has its values in another file; save it as a vector of numbers under this name"
    return shape_complaint(item.shape or (0,))


def shape_complaint(shape: tuple[int, ...]) -> str | None:
    """Return why an array of this shape is no column, in words that continue "column 'x' …", else None."""
    size = math.prod(shape)
    if size == 1:
        return "is a single number; save one value for each sample"
    if size == 0 or size != max(shape):
        return f"is an array of {' × '.join(map(str, shape))}; save it as a vector, one value for each sample"
    return None


def _guard(memory_bytes: int, seconds: float) -> None:
    """Limit this process's memory [bytes] and its further processor time [s], if the system supports it."""
    try:
        import resource
    except ImportError:  # not on Windows
        return
    ends = int(time.process_time() + seconds) + 1
    for kind, most in ((resource.RLIMIT_AS, memory_bytes), (resource.RLIMIT_CPU, ends)):
        hard = resource.getrlimit(kind)[1]
        soft = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (soft, hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))


def main() -> None:
    """Read requests, each a line of JSON on stdin, and write their answers to stdout, until stdin ends."""
    answer = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    # Libraries print to stdout, which must contain the answers only: their output is sent to stderr.
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    for line in sys.stdin.buffer:
        request = json.loads(line)
        _guard(request["memory_bytes"], request["seconds"])
        try:
            held = read(request["kind"], request["path"], Most(*request["most"]), request["wanted"])
        except UnreadableError as error:
            answer.write(json.dumps({"error": str(error)}).encode() + b"\n")
        else:
            _write(held, answer)
        answer.flush()


def _write(held: Held, answer: BinaryIO) -> None:
    """Write a line of JSON, then the columns' numbers as bytes."""
    # Several columns often have the same times, therefore each array is sent once only.
    arrays: dict[int, Any] = {}

    def place(values: Any) -> int:
        arrays[id(values)] = values
        return list(arrays).index(id(values))

    header = {
        "rows": held.rows,
        "columns": held.columns,
        "unusable": held.unusable,
        "numeric": {name: place(values) for name, values in held.numeric.items()},
        "times": {name: place(values) for name, values in held.times.items()},
        "texts": {name: [distinct, place(numbers)] for name, (distinct, numbers) in held.texts.items()},
        "lengths": [values.size for values in arrays.values()],
    }
    answer.write(json.dumps(header).encode() + b"\n")
    answer.writelines(np.ascontiguousarray(values, float).tobytes() for values in arrays.values())


if __name__ == "__main__":
    main()
