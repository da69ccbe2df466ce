"""Text tables: as data for a page, aligned for a terminal, and in Markdown; numbers as text."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

NOTHING = "–"
"""Text of a cell without a value."""

LARGE = 1e6
"""Absolute value from which a number is written with a power of ten."""


@dataclass(frozen=True)
class TextTable:
    """Rows of text under a header; the first cell of a row is its name."""

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def format_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return `header` and `rows`, with equal numbers of cells, as an aligned text table."""
    widths = [max(len(row[i]) for row in [header, *rows]) for i in range(len(header))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in [header, *rows]
    ]
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]], *, words: int = 1) -> str:
    """Return a Markdown table: the first `words` columns are left-aligned, the others right-aligned."""
    rule = ["---"] * words + ["---:"] * (len(header) - words)
    return "\n".join(f"| {' | '.join(row)} |" for row in [header, rule, *rows])


def with_digits(value: float, digits: int = 2) -> str:
    """Return `value` with `digits` significant digits, without exponent below a million: 2000, not 2e+03."""
    shortest = f"{value:.{digits}g}"
    return f"{float(shortest):.0f}" if "e+" in shortest and abs(value) < LARGE else shortest


def counted(count: int, singular: str, plural: str = "") -> str:
    """Return a number with its noun: `singular`, or `plural`, which is `singular` with an s if omitted."""
    return f"{count} {singular if count == 1 else plural or f'{singular}s'}"
