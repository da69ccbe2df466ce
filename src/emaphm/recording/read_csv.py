"""CSV: comma-separated, one header row, a point as the decimal sign."""

import csv
import io
from collections import Counter
from typing import TYPE_CHECKING

from emaphm.errors import RecordingError
from emaphm.recording.checks import COUNTING
from emaphm.recording.table import Table, excerpt, reason

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
    import polars as pl  # noqa: PLC0415 - heavy

    try:
        # As text, to show a value that is no number with its row; stripped, for files end in blank lines.
        rows = pl.read_csv(content.rstrip(), has_header=False, infer_schema=False)
    except pl.exceptions.PolarsError as error:
        complaint = _uneven_row(content) or (
            f"not a readable CSV file ({reason(error)}); export it again as comma-separated UTF-8 text"
        )
        raise RecordingError(f"{source}: {complaint}") from None
    names = [" ".join((name or "").split()) for name in rows.row(0)]
    _check_header(names, source)
    table = Table({}, {})
    for name, column in zip(names, rows.slice(1).get_columns(), strict=True):
        if name:
            _add(table, name, column)
    return table


def _check_header(names: list[str], source: str) -> None:
    for separator, written in FOREIGN_SEPARATORS.items():
        if len(names) == 1 and separator in names[0]:
            raise RecordingError(
                f"{source}: the header is separated by {written}; save the file with commas between columns "
                "and points in numbers"
            )
    for name, count in Counter(names).items():
        if name and count > 1:
            raise RecordingError(
                f"{source}: the header has {count} columns named '{name}'; rename or drop all but one"
            )


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
    text = io.StringIO(content.decode("utf-8", errors="replace"), newline="")
    try:
        lines = csv.reader(text)
        columns = len(next(lines, []))
        for number, line in enumerate(lines, start=1):
            if len(line) > columns:
                return (
                    f"row {number} has {len(line)} values where the header names {columns} columns; mend "
                    f"that row, and use points as the decimal sign ({COUNTING})"
                )
    except csv.Error:
        return None
    return None
