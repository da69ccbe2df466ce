"""Columns of a file, before they are assigned to the channels of the schema."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.errors import RecordingError


@dataclass(frozen=True)
class FileColumns:
    """Columns of a file by their names in the file.

    `numeric` contains arrays of shape (n,), NaN where a value is absent. `unusable` gives for each other
    column the reason why it is not numeric, in words that continue "column 'x' …" and end with the remedy.
    `texts` contains the unusable columns that are texts, shape (n,) of str, and columns that are both numbers
    and names, such as 0042. `times` contains the times [s] of the numeric columns for which the format has a
    separate time base.
    """

    numeric: dict[str, Array]
    unusable: dict[str, str]
    texts: dict[str, NDArray[Any]] = field(default_factory=dict)
    times: dict[str, Array] = field(default_factory=dict)


def check_names(names: Iterable[str], source: str) -> None:
    """Raise `RecordingError` if two columns have the same name; several may be without a name."""
    for name, count in Counter(names).items():
        if name and count > 1:
            raise RecordingError(
                f"{source}: the file has {count} columns named '{name}'; rename or drop all but one"
            )


def reason(error: BaseException) -> str:
    """Return the first line of the message of a library's error, without its period."""
    lines = str(error).strip().splitlines()
    return lines[0].rstrip(".") if lines else type(error).__name__


def tidy(name: str | None) -> str:
    """Return a column name from a file with sequences of blanks and line breaks replaced by single blanks."""
    return " ".join((name or "").split())


def excerpt(value: object) -> str:
    """Return a value from a file, shortened to 30 characters for an error message."""
    text = repr(value)
    return text if len(text) <= 30 else f"{text[:27]}..."
