"""The fleet as pages and API show it: one row a unit, kept in memory and read again where it has changed."""

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
"""What may be advised, the most urgent first."""

NEVER = float("inf")


@dataclass(frozen=True)
class FleetRow:
    """A unit: its last flight, its last diagnosis, and its prognosis, null where there is none yet.

    Hours are flight hours [h]; `rul_low`, `rul_high` the ends of the 90 % interval, null beyond what is
    forecast; `failed_at` when the unit failed, null while it is in service; `alarms` are those that were
    raised and not cleared; `advice` is good for `advice_in` hours from the prognosis on, at `advice_at`;
    `current` says whether the prognosis covers all that was added.
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
        """Action, hours until then, RUL: less is more urgent; a unit without advice is in between."""
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
"""By what units are sorted."""


@dataclass(frozen=True)
class Choice:
    """Which units are shown, and in which order."""

    sort: str = "urgency"
    descending: bool = False
    part: str = ""
    advice: str = ""
    health: str = ""
    search: str = ""

    def of(self, rows: Iterable[FleetRow]) -> list[FleetRow]:
        """Return the rows that are asked for, in order."""
        text = self.search.strip().lower()
        chosen = [
            row
            for row in rows
            if self.part in ("", row.part_number)
            and self.health in ("", row.health)
            and self.advice in ("", row.advice or "none")
            and (text in row.unit.lower() or text in (row.position or "").lower())
        ]
        chosen.sort(key=lambda row: row.unit)
        return sorted(chosen, key=SORTS[self.sort], reverse=self.descending)


@dataclass(frozen=True)
class Fleet:
    """All units at one moment; `version` rises with each change."""

    version: int
    rows: tuple[FleetRow, ...]

    @property
    def part_numbers(self) -> list[str]:
        """The part numbers of the units."""
        return sorted({row.part_number for row in self.rows})

    def recordings(self, unit_id: int | None = None, explained: bool | None = None) -> int:
        """Return how many recordings all units have, or one; only those `explained`, or not, where said."""
        rows = [row for row in self.rows if unit_id in (None, row.id)]
        good, every = sum(row.explained for row in rows), sum(row.recordings for row in rows)
        return every if explained is None else good if explained else every - good


class FleetView:
    """Gives the fleet as it is now; only what has changed since is read again."""

    def __init__(self, history: "History") -> None:
        self._history = history
        self._lock = threading.Lock()
        self._marks: Marks | None = None
        self._states: dict[int, UnitState] = {}
        self._prognoses: dict[str, KeptPrognosis] = {}
        self._alarms: dict[str, tuple[str, ...]] = {}
        self._fleet = Fleet(0, ())
        self._asked: dict[str, Basis] = {}

    def fleet(self) -> Fleet:
        """Return the fleet; `HistoryError` where the database fails."""
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
                _row(one, self._prognoses.get(one.serial_number), self._alarms.get(one.serial_number, ()))
                for one in self._states.values()
            )
            self._fleet = Fleet(self._fleet.version + 1, rows)
            self._marks = now
            return self._fleet

    def ids(self) -> dict[str, int]:
        """Return the id of each unit by its serial number."""
        return {row.unit: row.id for row in self.fleet().rows}

    def row(self, unit_id: int) -> FleetRow | None:
        """Return the row of a unit, None where there is none of that id."""
        return next((row for row in self.fleet().rows if row.id == unit_id), None)

    def prognosis(self, unit: str) -> KeptPrognosis | None:
        """Return the kept prognosis of the unit with this serial number."""
        return self._prognoses.get(unit)

    def outdated(self) -> str | None:
        """Return a unit whose prognosis is out of date and was not asked for since; the most urgent first."""
        rows = Choice().of(self.fleet().rows)
        with self._lock:
            for row in rows:
                state = self._states[row.id]
                if not row.current and self._asked.get(row.unit) != state.basis:
                    self._asked[row.unit] = state.basis
                    return row.unit
        return None

    def forecast(self, unit: str, state: str) -> None:
        """Take note of the state that the prognosis of a unit has ended in.

        One that is done is read. One that is to be tried again is out of date as before. Others wait until
        something is added.
        """
        with self._lock:
            if state == DONE and self._marks is not None:
                self._marks = self._marks._replace(prognoses=NO_PROGNOSES)
            if state == AGAIN:
                self._asked.pop(unit, None)


def _alarms(connection: "Connection") -> dict[str, tuple[str, ...]]:
    """Return the alarms of each unit that are open, by its serial number."""
    found: dict[str, tuple[str, ...]] = {}
    for one in read_open_conditions(connection):
        if one.unit is not None and one.severity == "alarm":
            found[one.unit] = (*found.get(one.unit, ()), one.message)
    return found


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
        sensor_faults=tuple(one["sentence"] for one in state.document.get("sensor_faults", ())),
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
