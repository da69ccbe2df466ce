"""What is put into a history, and taken out, as values that check themselves."""

import math
from dataclasses import dataclass, field
from typing import Any

from emaphm.actuator.faults import COMPONENTS
from emaphm.actuator.quantity import COLDEST, HOTTEST
from emaphm.actuator.requirements import LOWEST_FRICTION
from emaphm.errors import HistoryError, nearest

UNIT = "unit"
"""The component of a finding that concerns the unit as a whole."""

FINDABLE = (*COMPONENTS, UNIT)
"""What a shop can report on, or replace."""

ALIKE = 0.6
"""Similarity from which on a component's name is suggested: shops have words for parts that are none here."""

REASONS = ("failed", "suspected", "scheduled", "other")
"""Why a unit was removed; "failed" and "suspected" as it was seen on the aircraft, before any shop."""

CONDITIONS = ("failed", "degraded", "healthy")
"""What a shop found: no longer within its requirements; worn, but within; nothing wrong."""

KINDS = ("recording", "removal", "finding")
"""What can be withdrawn."""

MOST_HOURS = 1e6
"""Flight hours: more than a century of them."""

MOST_CYCLES = 2**31 - 1
"""What every database holds as a whole number."""

LONGEST_NAME = 200
"""Characters of a serial number, a part number or a position."""

LONGEST_NOTE = 2000


@dataclass(frozen=True)
class Entry:
    """Whose recordings are added, and when they were made.

    Parameters
    ----------
    unit, part_number
        Serial number, unique in a history, and part number.
    hours, cycles
        Flight hours [h] and cycles of the unit since it was new, at the recording.
    position
        Place on the aircraft, e.g. "left aileron, inboard"; None: as at its last flight.
    load, temperature
        Mean size of the load [N·m; N of a linear actuator] and mean temperature [K] since its flight before:
        what wears it. None: not known.
    late
        Whether `hours` may be below what the history has of the unit already.

    Raises
    ------
    HistoryError
        A name is empty, too long or not printable; hours, cycles or load are no number of 0 or more, or the
        temperature is none of kelvins.
    """

    unit: str
    part_number: str
    hours: float
    cycles: int | None = None
    position: str | None = None
    late: bool = False
    load: float | None = None
    temperature: float | None = None

    def __post_init__(self) -> None:
        check_name(self.unit, "unit")
        check_name(self.part_number, "part number")
        check_hours(self.hours)
        if self.cycles is not None and not 0 <= self.cycles <= MOST_CYCLES:
            raise HistoryError(f"cycles {self.cycles}: give a whole number from 0 to {MOST_CYCLES:,}")
        if self.position is not None:
            check_name(self.position, "position")
        if self.load is not None and not (math.isfinite(self.load) and self.load >= 0):
            raise HistoryError(f"load {self.load:g}: give its mean size, a number of 0 or more")
        if self.temperature is not None and not COLDEST <= self.temperature <= HOTTEST:
            raise HistoryError(
                f"temperature {self.temperature:g}: give kelvins, from {COLDEST:g} to {HOTTEST:g}"
            )


def whole_cycles(text: str) -> int:
    """Return the cycles of an `Entry` that a file or a form states; what is no whole number is not rounded.

    Raises
    ------
    HistoryError
        The text is no whole number from 0 to `MOST_CYCLES`. The error does not repeat it: in a stream it may
        differ from row to row, and rows that are left out are counted by their reason.
    """
    is_whole = text.isascii() and text.isdigit() and len(text) <= len(str(MOST_CYCLES))
    if not is_whole or int(text) > MOST_CYCLES:
        raise HistoryError(
            f"cycles are no whole number from 0 to {MOST_CYCLES:,}; correct them, or leave them out"
        )
    return int(text)


@dataclass(frozen=True)
class Flight:
    """Flight hours [h] and cycles of a unit at one of its flights, and where on the aircraft it was.

    `load` [N·m, N] and `temperature` [K] are their means since the flight before; None where not known.
    """

    hours: float
    cycles: int | None
    position: str | None
    load: float | None = None
    temperature: float | None = None


@dataclass(frozen=True)
class Removal:
    """A unit was taken off the aircraft at `hours` [h], for one of `REASONS`.

    Raises
    ------
    HistoryError
        The reason is unknown, hours are no number of 0 or more, or the note is too long.
    """

    hours: float
    reason: str
    note: str = ""

    def __post_init__(self) -> None:
        check_hours(self.hours)
        check_note(self.note)
        if self.reason not in REASONS:
            raise HistoryError(f"unknown reason '{self.reason}'{nearest(self.reason, REASONS)}")


@dataclass(frozen=True)
class Finding:
    """What a shop found of one of `FINDABLE`, of a unit that had `hours` [h]: one of `CONDITIONS`.

    `level` is the fault as the shop measured it, normalised as in `Faults`; `replaced` says whether the
    component was replaced.

    Raises
    ------
    HistoryError
        A name is unknown, a number is out of its range, or the note is too long.
    """

    hours: float
    component: str
    condition: str
    level: float | None = None
    replaced: bool = False
    note: str = ""

    def __post_init__(self) -> None:
        check_hours(self.hours)
        check_note(self.note)
        if self.component not in FINDABLE:
            similar = nearest(self.component, FINDABLE, alike=ALIKE)
            raise HistoryError(
                f"unknown component '{self.component}'{similar}; what is none of them is a finding on "
                f"'{UNIT}', with a note"
            )
        if self.condition not in CONDITIONS:
            raise HistoryError(f"unknown condition '{self.condition}'{nearest(self.condition, CONDITIONS)}")
        lowest = LOWEST_FRICTION if self.component == "friction" else 0.0
        if self.level is not None and not lowest <= self.level <= 1:
            raise HistoryError(
                f"level {self.level:g} lies outside [{lowest:g}, 1]; give it normalised, as a diagnosis does"
            )
        if self.level is not None and self.component == UNIT:
            raise HistoryError("a level is one component's, not the unit's; name the component")


@dataclass(frozen=True)
class Replacement:
    """A component was replaced when the unit had `hours` [h]; the component "unit" stands for all of them."""

    hours: float
    component: str


@dataclass(frozen=True)
class Mistake:
    """An entry at `hours` [h] of a unit that was made wrongly, one of `KINDS`, and why it was wrong.

    `which` names a recording (its file, or eight or more characters of its SHA-256) or a finding's component;
    it is needed where there are several at these hours.

    Raises
    ------
    HistoryError
        The kind is unknown, hours are no number of 0 or more, or the reason is empty or too long.
    """

    kind: str
    hours: float
    reason: str
    which: str | None = None

    def __post_init__(self) -> None:
        check_hours(self.hours)
        check_note(self.reason)
        if self.kind not in KINDS:
            raise HistoryError(f"cannot withdraw a '{self.kind}'{nearest(self.kind, KINDS)}")
        if not self.reason.strip():
            raise HistoryError("a withdrawal needs a reason; give one, for whoever reads the history later")


@dataclass(frozen=True)
class Withdrawal:
    """What was withdrawn: one of `KINDS` at `hours` [h], when (UTC, ISO 8601) and why.

    `subject` is a recording's name, a removal's reason or a finding's component; `entry` has all that the
    history held of it, its diagnoses among it.
    """

    kind: str
    hours: float
    subject: str
    reason: str
    at: str
    entry: dict[str, Any] = field(repr=False)


def check_name(name: str, what: str) -> None:
    """Refuse a name that a table or a database cannot hold, `HistoryError`."""
    if not name.strip() or not name.isprintable():
        raise HistoryError(f"{what} {name!r} is no name; give printable characters")
    if len(name) > LONGEST_NAME:
        raise HistoryError(f"{what} '{name[:20]}…' has {len(name)} characters; give {LONGEST_NAME} at most")


def check_note(note: str) -> None:
    """Refuse a note that a database cannot hold, `HistoryError`."""
    if len(note) > LONGEST_NOTE or not note.replace("\n", " ").isprintable():
        raise HistoryError(f"a note has up to {LONGEST_NOTE} printable characters; shorten it")


def check_hours(hours: float) -> None:
    """Refuse hours that no unit has, `HistoryError`: what is in a history stays there."""
    if not 0 <= hours <= MOST_HOURS:
        raise HistoryError(
            f"hours {hours:.9g}: give a number from 0 to {MOST_HOURS:,.0f}, the unit's since it was new"
        )
