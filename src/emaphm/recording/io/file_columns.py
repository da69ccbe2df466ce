"""What a file holds, before its columns are given their names in the schema."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.errors import RecordingError


@dataclass(frozen=True)
class FileColumns:
    """Columns of a file by the names they have there.

    `numeric` holds arrays of shape (n,), NaN where a value is absent; `unusable` says of each other
    column why it is none, in words that continue "column 'x' …" and end with the remedy. `texts` holds those
    of the unusable ones that are texts, shape (n,) of str, and what is both a number and a name, as 0042 is.
    `times` holds the times [s] of the numeric columns that have a time base of their own, as the format says.
    """

    numeric: dict[str, Array]
    unusable: dict[str, str]
    texts: dict[str, NDArray[Any]] = field(default_factory=dict)
    times: dict[str, Array] = field(default_factory=dict)


def check_names(names: Iterable[str], source: str) -> None:
    """Raise `RecordingError` where two columns have the same name; nameless ones may be several."""
    for name, count in Counter(names).items():
        if name and count > 1:
            raise RecordingError(
                f"{source}: the file has {count} columns named '{name}'; rename or drop all but one"
            )


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
