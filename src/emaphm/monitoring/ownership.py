"""Whose recording it is, and at which flight hours: by the file's name, its columns, or the command."""

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
"""What a pattern of file names may hold in braces, and what each matches."""

UNIT_LABELS = ("unit", SERIAL)
HOURS_LABEL, CYCLES_LABEL = "hours", "cycles"

ROW = "row"
"""In place of a file's name, for a row of a stream."""

MOST_EXACT = 2.0**53
"""Up to which a column of numbers keeps each whole one."""


@dataclass(frozen=True)
class NamePattern:
    """A pattern of file names such as "{unit}_{hours}.csv"."""

    text: str
    expression: re.Pattern[str]

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the pattern that a user wrote; `MonitoringError` where it names something unknown, or twice.

        "{any}" stands for any text and may be repeated.
        """
        parts, seen = [], set()
        for literal, name in re.findall(r"([^{}]*)(?:\{([^{}]*)\})?", text):
            parts.append(re.escape(literal))
            if not name:
                continue
            if name not in FIELDS:
                raise MonitoringError(f"--name {text}: unknown '{{{name}}}'{nearest(name, FIELDS)}")
            if name in seen:
                raise MonitoringError(f"--name {text}: '{{{name}}}' stands there twice; write {{any}} once")
            seen |= {name} - {"any"}
            parts.append(FIELDS[name] if name == "any" else f"(?P<{name}>{FIELDS[name]})")
        if not seen:
            raise MonitoringError(f'--name {text}: names nothing; give e.g. "{{unit}}_{{hours}}.csv"')
        return cls(text, re.compile("".join(parts)))

    def values(self, name: str) -> dict[str, str]:
        """Return what a file's name says; nothing where it does not match."""
        found = self.expression.fullmatch(name)
        return found.groupdict() if found else {}


@dataclass(frozen=True)
class Ownership:
    """How a recording's unit and hours are known.

    What the file's name says by `pattern` goes before columns of the file that are the same throughout
    ("unit" or the serial number of [reading]; "hours"; "cycles"), these before `unit` and `hours`. `part` is
    the part number of all of them.

    Raises
    ------
    HistoryError
        A name or the hours cannot be.
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
            Its unit or its hours are not known, or its cycles are no whole number.
        HistoryError
            They are, and cannot be.
        """
        named = self.pattern.values(name) if self.pattern else {}
        unit = named.get("unit") or _first(name, labels, UNIT_LABELS) or self.unit
        hours = named.get(HOURS_LABEL) or _first(name, labels, (HOURS_LABEL,)) or self.hours
        cycles = named.get(CYCLES_LABEL) or _first(name, labels, (CYCLES_LABEL,))
        for value, what in ((unit, "unit is"), (hours, "hours are")):
            if value is None:
                raise RecordingError(f"{name}: its {what} not known; {self._remedy(name, what.split()[0])}")
        return Entry(
            str(unit),
            self.part,
            _hours(name, hours),
            None if cycles is None else _cycles(name, cycles),
            late=True,
        )

    def _remedy(self, name: str, what: str) -> str:
        """Return how the unit or the hours could be known."""
        if name == ROW:
            return f"give --{what} or a column '{what}'"
        way = 'a pattern of the name such as --name "{unit}_{hours}.csv"'
        if self.pattern is not None and not self.pattern.values(name):
            way = f"a name that matches --name {self.pattern.text}, as this one does not"
        return f"give --{what}, a column '{what}', or {way}"


def _first(file: str, labels: Mapping[str, Label], names: tuple[str, ...]) -> str | None:
    """Return the first label of those `names`, a number with all of its digits."""
    found = next((name for name in names if name in labels), None)
    if found is None:
        return None
    value = labels[found]
    if isinstance(value, str):
        return value
    if abs(value) > MOST_EXACT:
        raise RecordingError(
            f"{file}: its {found}, {value:g}, has more digits than a number keeps; write it with a letter"
        )
    if value == int(value):
        return str(int(value))
    if names == UNIT_LABELS:
        raise RecordingError(
            f"{file}: its {found}, {value!r}, is a number with decimals, which keeps no zeros at the end, so "
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
