"""Entries of a history and their withdrawals, as values that check themselves."""

import math
from dataclasses import dataclass, field
from typing import Any

from emaphm.actuator.faults import COMPONENTS
from emaphm.actuator.quantity import COLDEST, HOTTEST
from emaphm.actuator.requirements import LOWEST_FRICTION
from emaphm.errors import HistoryError, nearest

UNIT = "unit"
"""Component of a finding on the unit as a whole."""

FINDABLE = (*COMPONENTS, UNIT)
"""Components that a shop can report on, or replace."""

ALIKE = 0.6
"""Similarity from which on a component's name is suggested: shops also name parts that are no component."""

REASONS = ("failed", "suspected", "scheduled", "other")
"""Reasons for a removal; "failed" and "suspected" according to the aircraft, before any shop finding."""

CONDITIONS = ("failed", "degraded", "healthy")
"""Conditions found by a shop: outside its requirements; worn, but within them; without a fault."""

KINDS = ("recording", "removal", "finding")
"""Kinds of entries that can be withdrawn."""

MOST_HOURS = 1e6
"""Largest flight hours: more than a century."""

MOST_CYCLES = 2**31 - 1
"""Largest integer that every database can store."""

LONGEST_NAME = 200
"""Largest number of characters of a serial number, a part number or a position."""

LONGEST_NOTE = 2000


@dataclass(frozen=True)
class Entry:
    """Unit and flight of the recordings to be added.

    Parameters
    ----------
    unit, part_number
        Serial number, unique in a history, and part number.
    hours, cycles
        Flight hours [h] and cycles of the unit since it was new, at the recording.
    position
        Position on the aircraft, e.g. "left aileron, inboard"; None: as at its last flight.
    load, temperature
        Mean size of the load [N·m; N of a linear actuator] and mean temperature [K] since the previous
        recorded flight, i.e. the stress. None: not known.
    late
        Whether `hours` may be below those of the unit's latest entry.

    Raises
    ------
    HistoryError
        A name is empty, too long or not printable; hours, cycles or load are not a number of 0 or more, or
        the temperature is outside the range of actuators in kelvins.
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
    """Return the cycles of an `Entry` from the text of a file or a form; they are not rounded.

    Raises
    ------
    HistoryError
        The text is not a whole number from 0 to `MOST_CYCLES`. The message does not contain the text: in a
        stream it may differ between rows, and rejected rows are counted by their message.
    """
    is_whole = text.isascii() and text.isdigit() and len(text) <= len(str(MOST_CYCLES))
    if not is_whole or int(text) > MOST_CYCLES:
        raise HistoryError(
            f"cycles are no whole number from 0 to {MOST_CYCLES:,}; correct them, or leave them out"
        )
    return int(text)


@dataclass(frozen=True)
class Flight:
    """Flight hours [h], cycles and position on the aircraft of a unit at one of its flights.

    `load` [N·m, N] and `temperature` [K] are means since the previous recorded flight; None if unknown.
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
        The reason is unknown, hours are not a number of 0 or more, or the note is too long.
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
    """A shop's finding on one of `FINDABLE`, at the unit's `hours` [h]: one of `CONDITIONS`.

    `level` is the fault that the shop measured, normalised as in `Faults`; `replaced` is True if the
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
                f"unknown component '{self.component}'{similar}; report anything else as a finding on "
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
    """A replacement of a component at the unit's `hours` [h]; the component "unit" means all components."""

    hours: float
    component: str


@dataclass(frozen=True)
class Mistake:
    """A wrong entry of a unit at `hours` [h], one of `KINDS`, and the reason why it is wrong.

    `which` names a recording (its file, or eight or more characters of its SHA-256) or a finding's component;
    it is needed if there are several entries at these hours.

    Raises
    ------
    HistoryError
        The kind is unknown, hours are not a number of 0 or more, or the reason is empty or too long.
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
    """A withdrawn entry: one of `KINDS` at `hours` [h], with time `at` (UTC, ISO 8601) and reason.

    `subject` is a recording's name, a removal's reason or a finding's component; `entry` has all stored
    values of the entry, including its diagnoses.
    """

    kind: str
    hours: float
    subject: str
    reason: str
    at: str
    entry: dict[str, Any] = field(repr=False)


def check_name(name: str, what: str) -> None:
    """Refuse a name that a table or a database cannot store, `HistoryError`."""
    if not name.strip() or not name.isprintable():
        raise HistoryError(f"{what} {name!r} is no name; give printable characters")
    if len(name) > LONGEST_NAME:
        raise HistoryError(f"{what} '{name[:20]}…' has {len(name)} characters; give {LONGEST_NAME} at most")


def check_note(note: str) -> None:
    """Refuse a note that a database cannot store, `HistoryError`."""
    if len(note) > LONGEST_NOTE or not note.replace("\n", " ").isprintable():
        raise HistoryError(f"a note has up to {LONGEST_NOTE} printable characters; shorten it")


def check_hours(hours: float) -> None:
    """Refuse hours outside the possible range, `HistoryError`: entries of a history are permanent."""
    if not 0 <= hours <= MOST_HOURS:
        raise HistoryError(
            f"hours {hours:.9g}: give a number from 0 to {MOST_HOURS:,.0f}, the unit's since it was new"
        )
