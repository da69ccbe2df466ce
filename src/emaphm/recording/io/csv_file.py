"""CSV: comma-separated, one header row, a point as the decimal sign."""

import csv
import io
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from emaphm.errors import RecordingError
from emaphm.recording.checks import COUNTING
from emaphm.recording.io.table import Table, excerpt, reason, tidy

if TYPE_CHECKING:
    import polars as pl

FOREIGN_SEPARATORS = {";": "';'", "\t": "tabs", "|": "'|'"}


def read_csv(content: bytes, source: str) -> Table:
    """Read the columns of a CSV file.

    Parameters
    ----------
    content
        The file's bytes.
    source
        Its name, for errors.

    Raises
    ------
    RecordingError
        It is no CSV text, its rows differ in length, or two columns have the same name.
    """
    import polars as pl

    # Files often begin or end with blank lines, which polars takes for rows.
    content = content.strip()
    try:
        # As text, so that a value that is no number can be shown with its row.
        rows = pl.read_csv(content, has_header=False, infer_schema=False)
    except pl.exceptions.PolarsError as error:
        complaint = _uneven_row(content) or (
            f"not a readable CSV file ({reason(error)}); export it again as comma-separated UTF-8 text"
        )
        raise RecordingError(f"{source}: {complaint}") from None
    names = _column_names(rows.row(0), source)
    table = Table({}, {})
    for name, column in zip(names, rows.slice(1).get_columns(), strict=True):
        if name:
            _add(table, name, column)
    return table


def _column_names(header: Sequence[str | None], source: str) -> list[str]:
    for separator, written in FOREIGN_SEPARATORS.items():
        if len(header) == 1 and separator in (header[0] or ""):
            raise RecordingError(
                f"{source}: the header is separated by {written}; save the file with commas between columns "
                "and points in numbers"
            )
    names = [tidy(name) for name in header]
    for name, count in Counter(names).items():
        if name and count > 1:
            raise RecordingError(
                f"{source}: the header has {count} columns named '{name}'; rename or drop all but one"
            )
    return names


def _add(table: Table, name: str, column: "pl.Series") -> None:
    text = column.str.strip_chars()
    numbers = text.cast(float, strict=False)
    wrong = (numbers.is_null() & text.is_not_null() & (text != "")).arg_true()
    if len(wrong):
        row = int(wrong[0])
        table.unusable[name] = (
            f"holds {excerpt(text[row])} at row {row + 1}, which is no number; mend or drop it ({COUNTING})"
        )
    else:
        table.numeric[name] = numbers.to_numpy()


def _uneven_row(content: bytes) -> str | None:
    """Say which row has more values than the header, for polars does not."""
    try:
        lines = csv.reader(io.StringIO(content.decode("utf-8"), newline=""))
        columns = len(next(lines))
        for number, line in enumerate(lines, start=1):
            if len(line) > columns:
                return (
                    f"row {number} has {len(line)} values where the header names {columns} columns; mend "
                    f"that row, and use points as the decimal sign ({COUNTING})"
                )
    except (UnicodeDecodeError, csv.Error, StopIteration):
        return None
    return None
