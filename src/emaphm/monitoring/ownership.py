"""Unit, flight hours and cycles of a recording, from the file's name, its columns, or the command line."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from emaphm.errors import HistoryError, MonitoringError, RecordingError, nearest
from emaphm.history import Entry
from emaphm.history.records import whole_cycles
from emaphm.recording.io.read import SERIAL
from emaphm.recording.recording import Label

FIELDS = {"unit": r".+?", "hours": r"\d+(?:\.\d+)?", "cycles": r"\d+", "any": r".*?"}
"""Names in braces that a pattern of file names may contain, with their regular expressions."""

UNIT_LABELS = ("unit", SERIAL)
HOURS_LABEL, CYCLES_LABEL = "hours", "cycles"

ROW = "row"
"""Name of a row of a stream, in place of a file's name."""

MOST_EXACT = 2.0**53
"""Largest number up to which all integers are exact in a column of numbers."""


@dataclass(frozen=True)
class NamePattern:
    """A pattern of file names such as "{unit}_{hours}.csv"."""

    text: str
    expression: re.Pattern[str]

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the pattern in `text`; `MonitoringError` if a name in braces is unknown or repeated.

        "{any}" matches any text and may be repeated.
        """
        parts, names = [], set()
        for literal, name in re.findall(r"([^{}]*)(?:\{([^{}]*)\})?", text):
            parts.append(re.escape(literal))
            if not name:
                continue
            if name not in FIELDS:
                raise MonitoringError(f"--name {text}: unknown '{{{name}}}'{nearest(name, FIELDS)}")
            if name in names:
                raise MonitoringError(f"--name {text}: '{{{name}}}' stands there twice; write {{any}} once")
            names |= {name} - {"any"}
            parts.append(FIELDS[name] if name == "any" else f"(?P<{name}>{FIELDS[name]})")
        if not names:
            raise MonitoringError(f'--name {text}: names nothing; give e.g. "{{unit}}_{{hours}}.csv"')
        return cls(text, re.compile("".join(parts)))

    def values(self, name: str) -> dict[str, str]:
        """Return the values in a file's name by the names in braces, empty if it does not match."""
        match = self.expression.fullmatch(name)
        return match.groupdict() if match else {}


@dataclass(frozen=True)
class Ownership:
    """Rules for the unit, hours and cycles of a recording.

    Values in the file's name, according to `pattern`, have priority over constant columns of the file ("unit"
    or the serial number of [reading]; "hours"; "cycles"), and these over `unit` and `hours`. `part` is the
    part number of all units.

    Raises
    ------
    HistoryError
        A name or the hours are impossible.
    """

    part: str
    unit: str | None = None
    hours: float | None = None
    pattern: NamePattern | None = None

    def __post_init__(self) -> None:
        Entry(self.unit or "any", self.part, self.hours or 0.0)

    def entry(self, name: str, labels: Mapping[str, Label]) -> Entry:
        """Return the entry of a recording in the file `name`, or of a row of a stream, `ROW`.

        Raises
        ------
        RecordingError
            The unit or the hours are not known, or the cycles are no whole number.
        HistoryError
            The unit, hours or cycles are impossible.
        """
        named = self.pattern.values(name) if self.pattern else {}
        unit = named.get("unit") or _first(name, labels, UNIT_LABELS) or self.unit
        hours = named.get(HOURS_LABEL) or _first(name, labels, (HOURS_LABEL,)) or self.hours
        cycles = named.get(CYCLES_LABEL) or _first(name, labels, (CYCLES_LABEL,))
        for value, subject in ((unit, "unit is"), (hours, "hours are")):
            if value is None:
                remedy = self._remedy(name, subject.split()[0])
                raise RecordingError(f"{name}: its {subject} not known; {remedy}")
        return Entry(
            str(unit),
            self.part,
            _hours(name, hours),
            None if cycles is None else _cycles(name, cycles),
            late=True,
        )

    def _remedy(self, name: str, field: str) -> str:
        """Return the remedy in the error on an unknown unit or unknown hours."""
        if name == ROW:
            return f"give --{field} or a column '{field}'"
        way = 'a pattern of the name such as --name "{unit}_{hours}.csv"'
        if self.pattern is not None and not self.pattern.values(name):
            way = f"a name that matches --name {self.pattern.text}, as this one does not"
        return f"give --{field}, a column '{field}', or {way}"


def _first(file: str, labels: Mapping[str, Label], names: tuple[str, ...]) -> str | None:
    """Return the value of the first present label of `names` as text, None if there is none.

    A number is returned with all its digits; `RecordingError` if these are ambiguous.
    """
    label = next((name for name in names if name in labels), None)
    if label is None:
        return None
    value = labels[label]
    if isinstance(value, str):
        return value
    if names == UNIT_LABELS and abs(value) > MOST_EXACT:
        raise RecordingError(
            f"{file}: its {label}, {value:g}, has more digits than a number keeps; write it with a letter"
        )
    if float(value).is_integer():
        return str(int(value))
    if names == UNIT_LABELS:
        raise RecordingError(
            f"{file}: its {label}, {value!r}, is a number with decimals, which keeps no zeros at the end, so "
            "that 3.1 and 3.10 would be one unit; write it with a letter"
        )
    return repr(value)


def _hours(name: str, value: object) -> float:
    try:
        number = float(str(value))
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise RecordingError(f"{name}: its {HOURS_LABEL} are '{value}', which is no number; correct the file")
    return number


def _cycles(name: str, text: str) -> int:
    try:
        return whole_cycles(text)
    except HistoryError as error:
        raise RecordingError(f"{name}: its {error}") from None
