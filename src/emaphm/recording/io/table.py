"""What a file holds, before its columns are given their names in the schema."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Table:
    """Columns of a file by the names they have there.

    `numeric` holds arrays of shape (n,), NaN where a value is absent; `unusable` says of each other
    column why it is none, in words that continue "column 'x' …" and end with the remedy.
    """

    numeric: dict[str, NDArray[np.float64]]
    unusable: dict[str, str]


def reason(error: BaseException) -> str:
    """Return the first line of what a library says is wrong."""
    lines = str(error).strip().splitlines()
    return lines[0].rstrip(".") if lines else type(error).__name__


def tidy(name: str | None) -> str:
    """Return a column name from a file with its blanks and line breaks made single blanks."""
    return " ".join((name or "").split())


def excerpt(value: object) -> str:
    """Return a value from a file, short enough to stand in an error message."""
    text = repr(value)
    return text if len(text) <= 30 else f"{text[:27]}..."
