"""Parser of the lines of a stream into rows: NDJSON, or CSV with a header."""

import csv
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

Cells = dict[str, float | str]
"""A row: numbers and texts by column; NaN where a cell is empty."""


@dataclass(eq=False)
class RowParser:
    """Parses rows from bytes, which may be split at any place.

    The first line decides on the format: an object is NDJSON, any other line is the header of CSV. A further
    line that repeats the header, as in joined files, is skipped. `skipped` counts the lines that are no rows,
    by reason.
    """

    longest_line: int
    skipped: dict[str, int] = field(default_factory=dict)
    _rest: bytes = b""
    _is_cut: bool = False
    _header: list[str] | None = None
    _is_json: bool | None = None

    def feed(self, content: bytes) -> Iterator[Cells]:
        """Yield the rows that `content` completes."""
        *lines, rest = (self._rest + content).split(b"\n")
        self._rest = b""
        for line in lines:
            yield from self._line(line)
        if len(rest) > self.longest_line:
            self._is_cut = True
            rest = b""
        self._rest = rest

    def end(self) -> Iterator[Cells]:
        """Yield the last row if its line has no end; an incomplete row is skipped."""
        rest, self._rest = self._rest, b""
        if rest.strip():
            if self._is_json and not self._is_cut:
                yield from self._line(rest)
            else:
                self._skip("cut short at the end")

    def _line(self, line: bytes) -> Iterator[Cells]:
        if self._is_cut or len(line) > self.longest_line:
            self._is_cut = False
            self._skip(f"lines of more than {self.longest_line} bytes")
            return
        text = line.decode("utf-8", "replace").strip().removeprefix("\ufeff")
        if not text:
            return
        if self._is_json is None:
            self._is_json = text.startswith("{")
        if self._is_json:
            yield from self._of_json(text)
        else:
            yield from self._of_csv(text)

    def _of_json(self, text: str) -> Iterator[Cells]:
        try:
            values = json.loads(text)
        except (ValueError, RecursionError):
            values = None
        if not isinstance(values, dict):
            self._skip("no JSON objects")
            return
        yield {name: _cell(value) for name, value in values.items()}

    def _of_csv(self, text: str) -> Iterator[Cells]:
        try:
            cells = [cell.strip() for cell in next(csv.reader([text]))]
        except csv.Error:
            cells = []
        if self._header is None:
            self._header = cells
        elif cells == self._header:
            return
        elif len(cells) != len(self._header):
            self._skip("another number of cells than the header")
        else:
            yield {name: _number(cell) for name, cell in zip(self._header, cells, strict=True)}

    def _skip(self, reason: str) -> None:
        self.skipped[reason] = self.skipped.get(reason, 0) + 1


def _cell(value: object) -> float | str:
    if isinstance(value, str):
        return value
    if isinstance(value, int | float):  # bool too: 0 and 1
        try:
            return float(value)
        except OverflowError:
            return math.nan
    return math.nan


def _number(cell: str) -> float | str:
    if not cell:
        return math.nan
    try:
        return float(cell)
    except ValueError:
        return cell
