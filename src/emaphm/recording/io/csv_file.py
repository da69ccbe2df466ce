"""Reader of CSV files: comma-separated, with one header row and a point as the decimal sign."""

import csv
import io
import re
from collections.abc import Collection, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from emaphm.errors import RecordingError
from emaphm.input_files import read_bytes
from emaphm.recording.checks import COUNTING
from emaphm.recording.io.file_columns import FileColumns, check_names, excerpt, reason, tidy
from emaphm.recording.io.limits import ReadLimits

if TYPE_CHECKING:
    import polars as pl

FOREIGN_SEPARATORS = {";": "';'", "\t": "tabs", "|": "'|'"}

COMPRESSED = {b"\x1f\x8b": "gzip", b"\x28\xb5\x2f\xfd": "zstd", b"PK\x03\x04": "zip"}
"""First bytes of compressed files; some programs keep the ending .csv."""

BYTE_ORDER_MARK = b"\xef\xbb\xbf"

CELL = re.compile(rb'("(?:[^"]|"")*"|[^,\r\n]*)(?:,|\r?\n|\r|$)')
"""A cell of a row, with its quotes, and the separator after it."""

MOST_HEADER_BYTES = 2**16
"""Bytes in which the header and the first row are looked for: a stray quote could extend over the file."""


def read_csv(path: Path, limits: ReadLimits, _: Collection[str] = ()) -> FileColumns:
    """Read the columns of a CSV file.

    A file may be cut short within its last number. If the last line has no line end, the last value is
    accepted as complete only if it is quoted, or has at least as many characters as the longest value of its
    column, because a part of a number is shorter. Else its column is unusable.

    Parameters
    ----------
    path
        The file.
    limits
        Sizes beyond which the file is refused.

    Raises
    ------
    RecordingError
        The file is too large, compressed, or no CSV text, its rows differ in length, or two columns have the
        same name.
    """
    import polars as pl

    source = str(path)
    content = read_bytes(path, limits.file_bytes, RecordingError)
    for start, name in COMPRESSED.items():
        if content.startswith(start):
            raise RecordingError(f"{source}: is compressed ({name}); unpack it first")
    ends_in_line = content[-1:].isspace()
    # Files often begin or end with blank lines, which polars would read as rows.
    content = content.removeprefix(BYTE_ORDER_MARK).strip()
    if b"\n" not in content:  # line ends of old Macintosh programs
        content = content.replace(b"\r", b"\n")
    # Quoted line breaks are counted as rows here, which matters only for a file near the limit.
    limits.check(content.count(b"\n"), content.partition(b"\n")[0].count(b",") + 1, source)
    try:
        # Read as text, so that an error can quote a value that is no number with its row. With the byte order
        # mark, polars does not take text that begins with "x^" for compressed data.
        rows = pl.read_csv(BYTE_ORDER_MARK + content, has_header=False, infer_schema=False)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
        complaint = _uneven_row(content) or (
            f"not a readable CSV file ({reason(error)}); export it again as comma-separated UTF-8 text"
        )
        raise RecordingError(f"{source}: {complaint}") from None
    names = _column_names(rows.row(0), source)
    columns = FileColumns({}, {})
    quoted = _quoted(content, len(names))
    for number, (name, column) in enumerate(zip(names, rows.slice(1).get_columns(), strict=True)):
        if name:
            _add(columns, name, column, is_quoted=number in quoted)
    if not ends_in_line:
        _check_last_value(columns, names, rows, content)
    return columns


def _column_names(header: Sequence[str | None], source: str) -> list[str]:
    if len(header) == 1 and (complaint := _separated_otherwise(header[0] or "")):
        raise RecordingError(f"{source}: {complaint}")
    names = [tidy(name) for name in header]
    check_names(names, source)
    return names


def _separated_otherwise(header: str) -> str | None:
    """Return the complaint about a header with a separator other than the comma, else None."""
    for separator, written in FOREIGN_SEPARATORS.items():
        if separator in header:
            return (
                f"the header is separated by {written}; save the file with commas between columns and points "
                "in numbers"
            )
    return None


def _quoted(content: bytes, count: int) -> set[int]:
    """Return which of `count` columns are in quotes in the first row; none if all of them are.

    Programs that put only texts in quotes, as `write_recording` does, show thereby that 42 is a name.
    """
    cells = [match[1] for match in islice(CELL.finditer(content[:MOST_HEADER_BYTES]), 2 * count)]
    quoted = {number for number, cell in enumerate(cells[count:]) if cell.startswith(b'"')}
    return quoted if len(quoted) < count else set()


def _add(columns: FileColumns, name: str, column: "pl.Series", *, is_quoted: bool) -> None:
    """Add a column of text to `columns`, as numbers, texts or both; see `FileColumns`."""
    text = column.str.strip_chars()
    numbers = text.cast(float, strict=False)
    wrong = (numbers.is_null() & text.is_not_null() & (text != "")).arg_true()
    if len(wrong):
        row = int(wrong[0])
        columns.unusable[name] = (
            f"holds {excerpt(text[row])} at row {row + 1}, which is no number; correct or drop it "
            f"({COUNTING})"
        )
        columns.texts[name] = text.fill_null("").to_numpy()
    else:
        columns.numeric[name] = numbers.to_numpy()
        if _are_names(text) or (is_quoted and text.n_unique() == 1):
            columns.texts[name] = text.fill_null("").to_numpy()


def _are_names(text: "pl.Series") -> bool:
    """Return whether numbers are names such as serial numbers: all of digits, some like 0042 or 1E5.

    Programs that write numbers use an exponent with a sign, a decimal point before it, or a small e.
    """
    if not len(text) or not (text[0] or "0")[0].isdigit():
        return False
    return bool(text.str.contains(r"^\d+(E\d+)?$").all() and text.str.contains(r"^0\d|E").any())


def _check_last_value(columns: FileColumns, names: list[str], rows: "pl.DataFrame", content: bytes) -> None:
    """Make the column of the last value unusable if the value may be cut short; see `read_csv`."""
    last = content.rpartition(b"\n")[2]
    cells = last.count(b",") + 1
    if len(rows) < 2 or cells > len(names) or last.endswith((b'"', b",")):
        return
    name, value = names[cells - 1], last.rpartition(b",")[2].strip()
    before = rows.get_column(rows.columns[cells - 1]).slice(1, len(rows) - 2)
    longest = int(before.str.strip_chars().str.len_bytes().max() or 0)  # type: ignore[arg-type] # an integer
    if len(value) >= longest and cells == len(names):
        return
    columns.numeric.pop(name, None)
    columns.unusable[name] = (
        f"ends with {excerpt(value.decode(errors='replace'))} and no line end at row {len(rows) - 1}: the "
        f"file may be cut short; copy it again, or add a line end if that value is whole ({COUNTING})"
    )


def _uneven_row(content: bytes) -> str | None:
    """Return the complaint about the first row with more values than the header, else None."""
    try:
        lines = csv.reader(io.StringIO(content.decode("utf-8"), newline=""))
        header = next(lines)
        columns = len(header)
        if columns == 1 and (complaint := _separated_otherwise(header[0])):
            return complaint
        for number, line in enumerate(lines, start=1):
            if columns == 1 < len(line):
                return (
                    f"the first line, {excerpt(header[0])}, is no header of the {len(line)} columns below "
                    "it; take out what stands before the header"
                )
            if len(line) > columns:
                return (
                    f"row {number} has {len(line)} values where the header names {columns} columns; correct "
                    f"that row, and use points as the decimal sign ({COUNTING})"
                )
    except (UnicodeDecodeError, csv.Error, StopIteration):
        return None
    return None
