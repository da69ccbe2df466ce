"""The fleet for pages and API: one row per unit, cached in memory and read again after changes."""

import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from emaphm.actuator.faults import HEALTHS, degraded_in, health_in
from emaphm.history.events import read_open_conditions
from emaphm.history.kept_prognosis import KeptPrognosis, read_prognoses
from emaphm.history.views import NO_PROGNOSES, Marks, UnitState, changed_units, marks, states
from emaphm.server.work.queue import AGAIN, DONE

if TYPE_CHECKING:
    from sqlalchemy import Connection

    from emaphm.history import History
    from emaphm.history.basis import Basis

ACTIONS = ("replace before", "inspect by", "fly on")
"""Possible advice, the most urgent first."""

NEVER = float("inf")


@dataclass(frozen=True)
class FleetRow:
    """A unit: its last flight, its last diagnosis, and its prognosis, null if there is none yet.

    Hours are flight hours [h]. `rul_low` and `rul_high` are the ends of the 90 % interval, null beyond the
    forecast. `failed_at` is the time of a failure, null while the unit is in service. `alarms` are the open
    alarms. `advice` applies in `advice_in` hours from the prognosis, at `advice_at`. `current` is whether the
    prognosis includes all entries of the unit.
    """

    id: int
    unit: str
    part_number: str
    position: str | None
    hours: float
    cycles: int | None
    last_at: str
    recordings: int
    explained: int
    diagnosis: int
    health: str
    degraded: tuple[str, ...]
    reasons: tuple[str, ...]
    sensor_faults: tuple[str, ...]
    alarms: tuple[str, ...]
    advice: str | None
    advice_in: float | None
    advice_at: float | None
    risk: float | None
    probability_of_failure: float | None
    horizon: float | None
    rul: float | None
    rul_low: float | None
    rul_high: float | None
    fails_first: str | None
    failed_at: float | None
    current: bool

    @property
    def urgency(self) -> tuple[int, float, float]:
        """Sort key of action, hours until the action, and RUL; a lower key is more urgent.

        A unit without advice ranks between "inspect by" and "fly on".
        """
        rank = ACTIONS.index(self.advice) if self.advice in ACTIONS else 1.5
        return int(2 * rank), NEVER if self.advice_in is None else self.advice_in, _or_never(self.rul)


SORTS: dict[str, Callable[[FleetRow], Any]] = {
    "urgency": lambda row: row.urgency,
    "unit": lambda row: row.unit.lower(),
    "part": lambda row: row.part_number.lower(),
    "hours": lambda row: row.hours,
    "rul": lambda row: (row.advice is None, _or_never(row.rul)),
    "advice": lambda row: (row.urgency[0], row.advice_in or 0.0),
    "health": lambda row: (HEALTHS.index(row.health), row.degraded),
    "last": lambda row: row.last_at,
    "recordings": lambda row: row.recordings,
    "explained": lambda row: row.explained / row.recordings,
}
"""Sort keys of units by name."""


@dataclass(frozen=True)
class Choice:
    """Selection and order of the displayed units."""

    sort: str = "urgency"
    descending: bool = False
    part: str = ""
    advice: str = ""
    health: str = ""
    search: str = ""

    def of(self, rows: Iterable[FleetRow]) -> list[FleetRow]:
        """Return the selected rows, in order."""
        text = self.search.strip().lower()
        selected = [
            row
            for row in rows
            if self.part in ("", row.part_number)
            and self.health in ("", row.health)
            and self.advice in ("", row.advice or "none")
            and (text in row.unit.lower() or text in (row.position or "").lower())
        ]
        selected.sort(key=lambda row: row.unit)
        return sorted(selected, key=SORTS[self.sort], reverse=self.descending)


@dataclass(frozen=True)
class Fleet:
    """All units at one moment; `version` increases with each change."""

    version: int
    rows: tuple[FleetRow, ...]

    @property
    def part_numbers(self) -> list[str]:
        """The part numbers of the units."""
        return sorted({row.part_number for row in self.rows})

    def recordings(self, unit_id: int | None = None, explained: bool | None = None) -> int:
        """Return the number of recordings of all units or one unit; only (not) `explained` ones if given."""
        rows = [row for row in self.rows if unit_id in (None, row.id)]
        count, total = sum(row.explained for row in rows), sum(row.recordings for row in rows)
        return total if explained is None else count if explained else total - count


class FleetView:
    """The current fleet; only changed units are read again from the history."""

    def __init__(self, history: "History") -> None:
        self._history = history
        self._lock = threading.Lock()
        self._marks: Marks | None = None
        self._states: dict[int, UnitState] = {}
        self._prognoses: dict[str, KeptPrognosis] = {}
        self._alarms: dict[str, tuple[str, ...]] = {}
        self._fleet = Fleet(0, ())
        self._requested: dict[str, Basis] = {}

    def fleet(self) -> Fleet:
        """Return the current fleet; `HistoryError` if the database fails."""
        with self._lock, self._history.database.reading() as connection:
            now = marks(connection)
            before = self._marks
            if now == before:
                return self._fleet
            if before is None or before.withdrawal != now.withdrawal:
                self._states = states(connection)
            else:
                self._states |= states(connection, changed_units(connection, before))
            if before is None or before.prognoses != now.prognoses:
                self._prognoses = read_prognoses(connection)
            if before is None or before.event != now.event:
                self._alarms = _alarms(connection)
            rows = tuple(
                _row(unit, self._prognoses.get(unit.serial_number), self._alarms.get(unit.serial_number, ()))
                for unit in self._states.values()
            )
            self._fleet = Fleet(self._fleet.version + 1, rows)
            self._marks = now
            return self._fleet

    def ids(self) -> dict[str, int]:
        """Return the id of each unit by its serial number."""
        return {row.unit: row.id for row in self.fleet().rows}

    def row(self, unit_id: int) -> FleetRow | None:
        """Return the row of the unit with this id, None if there is none."""
        return next((row for row in self.fleet().rows if row.id == unit_id), None)

    def prognosis(self, unit: str) -> KeptPrognosis | None:
        """Return the stored prognosis of the unit with this serial number, None if there is none."""
        return self._prognoses.get(unit)

    def outdated(self) -> str | None:
        """Return the most urgent unit whose prognosis is out of date and not yet requested, else None."""
        rows = Choice().of(self.fleet().rows)
        with self._lock:
            for row in rows:
                state = self._states[row.id]
                if not row.current and self._requested.get(row.unit) != state.basis:
                    self._requested[row.unit] = state.basis
                    return row.unit
        return None

    def forecast(self, unit: str, state: str) -> None:
        """Note the final state of the prognosis of a unit.

        After `DONE`, prognoses are read again. After `AGAIN`, the prognosis of the unit is requested again.
        After other states, it is requested again when something is added.
        """
        with self._lock:
            if state == DONE and self._marks is not None:
                self._marks = self._marks._replace(prognoses=NO_PROGNOSES)
            if state == AGAIN:
                self._requested.pop(unit, None)


def _alarms(connection: "Connection") -> dict[str, tuple[str, ...]]:
    """Return the open alarms of each unit by serial number."""
    alarms: dict[str, tuple[str, ...]] = {}
    for event in read_open_conditions(connection):
        if event.unit is not None and event.severity == "alarm":
            alarms[event.unit] = (*alarms.get(event.unit, ()), event.message)
    return alarms


def _row(state: UnitState, prognosis: KeptPrognosis | None, alarms: tuple[str, ...]) -> FleetRow:
    return FleetRow(
        id=state.id,
        unit=state.serial_number,
        part_number=state.part_number,
        position=state.position,
        hours=state.hours,
        cycles=state.cycles,
        last_at=state.last_at,
        recordings=state.recordings,
        explained=state.explained,
        diagnosis=state.diagnosis_id,
        health=health_in(state.document),
        degraded=degraded_in(state.document),
        reasons=tuple(state.document.get("reasons", ())),
        sensor_faults=tuple(fault["sentence"] for fault in state.document.get("sensor_faults", ())),
        alarms=alarms,
        current=prognosis is not None and prognosis.is_current(state.basis),
        **_forecast(prognosis),
    )


def _forecast(prognosis: KeptPrognosis | None) -> dict[str, Any]:
    document: Any = prognosis.document if prognosis else {}
    advice, rul = document.get("advice", {}), document.get("rul_hours", {})
    low, high = rul.get("interval90", (None, None))
    return {
        "advice": advice.get("action"),
        "advice_in": advice.get("in_hours"),
        "advice_at": advice.get("at_hours"),
        "risk": advice.get("risk"),
        "probability_of_failure": document.get("probability_of_failure"),
        "horizon": document.get("horizon_hours"),
        "rul": rul.get("median"),
        "rul_low": low,
        "rul_high": high,
        "fails_first": document.get("requirement"),
        "failed_at": document.get("failed_at_hours"),
    }


def _or_never(hours: float | None) -> float:
    return NEVER if hours is None else hours
