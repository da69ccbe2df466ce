"""Events on a unit or on a watcher, with a time; each event is in a history once."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa

from emaphm.errors import HistoryError, nearest
from emaphm.history.storage.tables import EVENTS
from emaphm.history.writing import storable
from emaphm.strict_json import finite

KINDS = (
    "health_changed",
    "alarm",
    "rul_below_horizon",
    "sensor_fault",
    "not_like_healthy",
    "not_explained",
    "hours_behind",
    "refused",
    "rows_skipped",
    "back_pressure",
    "source_lost",
)
"""Kinds of events; docs/monitoring.md states when each is raised."""

STATES = ("raised", "cleared")
"""Start and end of a condition. An event without an end, such as a change of health, is only raised."""

SEVERITIES = ("info", "warning", "alarm")

CONDITION_KINDS = (
    "alarm",
    "rul_below_horizon",
    "sensor_fault",
    "not_like_healthy",
    "not_explained",
    "hours_behind",
    "back_pressure",
    "source_lost",
)
"""Kinds of conditions, which are raised and later cleared."""


@dataclass(frozen=True)
class Event:
    """One event; characters of its texts that a database cannot store are escaped.

    Attributes
    ----------
    kind, state, severity
        Values of `KINDS`, `STATES` and `SEVERITIES`.
    message
        A sentence.
    subject
        Subject of a condition within its unit and kind: a component or a channel; empty if there is only one.
    unit, hours
        Serial number and flight hours [h]; None for an event that is not on a unit.
    recording, recording_hash
        Name and SHA-256 of the recording that caused it.
    details
        Further values, ready for JSON.
    watcher
        Watcher that made it (`emaphm.monitoring`), empty for another source.
    at
        Time at which it was made, UTC, ISO 8601.
    number
        Number in the history, increasing; None before it is added.

    Raises
    ------
    HistoryError
        The kind, the state or the severity is unknown.
    """

    kind: str
    state: str
    severity: str
    message: str
    subject: str = ""
    unit: str | None = None
    hours: float | None = None
    recording: str | None = None
    recording_hash: str | None = None
    details: Mapping[str, Any] = field(default_factory=dict)
    watcher: str = ""
    at: str = field(default_factory=lambda: datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ"))
    number: int | None = None

    def __post_init__(self) -> None:
        for value, known in ((self.kind, KINDS), (self.state, STATES), (self.severity, SEVERITIES)):
            if value not in known:
                raise HistoryError(f"unknown '{value}' of an event{nearest(value, known)}")
        # Escaped here, so that key and condition are the same before and after it is added to a history.
        for item in fields(self):
            if isinstance(text := getattr(self, item.name), str):
                object.__setattr__(self, item.name, storable(text))

    @property
    def key(self) -> str:
        """Hash that identifies the event.

        It covers watcher, kind, state, unit and subject, and the hash of the recording. Without a recording,
        it covers the message, and the hash of the file (`file_sha256` in its details) or, without a file, the
        time. For an event from a prognosis, it also covers the basis (`made_from` in its details).
        """
        file = self.details.get("file_sha256")
        origin = self.recording_hash or f"{file or self.at} {self.message}"
        if "made_from" in self.details:
            origin += f" {json.dumps(self.details['made_from'], sort_keys=True)}"
        parts = (self.watcher, self.kind, self.state, self.unit, self.subject, origin)
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:32]

    @property
    def condition(self) -> tuple[str | None, str, str]:
        """The condition: unit, kind and subject."""
        return self.unit, self.kind, self.subject

    def to_dict(self) -> dict[str, Any]:
        """Return the event as a line of `emaphm watch`, and as the content sent to a webhook."""
        return {
            "event": self.kind,
            "state": self.state,
            "severity": self.severity,
            "id": self.key,
            "number": self.number,
            "at": self.at,
            "unit": self.unit,
            "hours": self.hours,
            "subject": self.subject,
            "message": self.message,
            "recording": self.recording,
            "recording_hash": self.recording_hash,
            "details": finite(dict(self.details)),
        }


def add_events(connection: sa.Connection, events: Sequence[Event]) -> int:
    """Add events in their order, without existing ones; return the number of new events.

    An event on a watcher's own condition also counts as existing if the last event on it has the same state:
    two processes of a watcher detect the loss of the same folder at different times.
    """
    new_count = 0
    for event in events:
        if connection.execute(sa.select(EVENTS.c.id).where(EVENTS.c.key == event.key)).first():
            continue
        if (
            event.unit is None
            and event.kind in CONDITION_KINDS
            and _last_state(connection, event) == event.state
        ):
            continue
        row = {
            name: getattr(event, name)
            for name in EVENTS.columns.keys()  # noqa: SIM118 - the collection is not a dict
            if name not in {"id", "details"}
        }
        connection.execute(EVENTS.insert().values(row | {"details": json.dumps(finite(dict(event.details)))}))
        new_count += 1
    return new_count


def read_events(
    connection: sa.Connection,
    *,
    unit: str | None = None,
    kinds: Sequence[str] = (),
    since: str | None = None,
    until: str | None = None,
    watcher: str | None = None,
    recording_hash: str | None = None,
    after: int | None = None,
    before: int | None = None,
    newest_first: bool = False,
    offset: int = 0,
    limit: int | None = None,
) -> tuple[Event, ...]:
    """Return events as `History.events`; further conditions are `watcher`, `recording_hash` and `before`.

    These select the events of one watcher, of one recording, and with lower numbers; the first `offset`
    events are left out.
    """
    query = sa.select(EVENTS).where(*_conditions(unit, kinds))
    if since is not None:
        query = query.where(EVENTS.c.at >= _moment(since))
    if until is not None:
        query = query.where(EVENTS.c.at < _moment(until))
    if watcher is not None:
        query = query.where(EVENTS.c.watcher == watcher)
    if recording_hash is not None:
        query = query.where(EVENTS.c.recording_hash == recording_hash)
    if after is not None:
        query = query.where(EVENTS.c.id > after)
    if before is not None:
        query = query.where(EVENTS.c.id < before)
    query = query.order_by(EVENTS.c.id.desc() if newest_first else EVENTS.c.id)
    return tuple(_event(row) for row in connection.execute(query.offset(offset).limit(limit)))


def count_events(connection: sa.Connection, *, unit: str | None = None, kinds: Sequence[str] = ()) -> int:
    """Return the number of events of a unit or of all, of `kinds` or, if empty, of all kinds."""
    query = sa.select(sa.func.count()).select_from(EVENTS).where(*_conditions(unit, kinds))
    return int(connection.execute(query).scalar_one())


def _conditions(unit: str | None, kinds: Sequence[str]) -> list[sa.ColumnElement[bool]]:
    """Return the conditions of a unit and of kinds."""
    of_unit = [] if unit is None else [EVENTS.c.unit == unit]
    return [*of_unit, *([EVENTS.c.kind.in_(kinds)] if kinds else [])]


def read_open_conditions(connection: sa.Connection, unit: str | None = None) -> tuple[Event, ...]:
    """Return the last event of each condition that was raised and not cleared, in their order.

    Conditions without a unit are separate for each watcher: a source that one watcher has found again may
    still be lost for another.
    """
    last = sa.select(sa.func.max(EVENTS.c.id)).where(EVENTS.c.kind.in_(CONDITION_KINDS))
    if unit is not None:
        last = last.where(EVENTS.c.unit == unit)
    owner = sa.case((EVENTS.c.unit.is_(None), EVENTS.c.watcher), else_="")
    last = last.group_by(EVENTS.c.unit, EVENTS.c.kind, EVENTS.c.subject, owner)
    query = sa.select(EVENTS).where(EVENTS.c.id.in_(last), EVENTS.c.state == "raised").order_by(EVENTS.c.id)
    return tuple(_event(row) for row in connection.execute(query))


def _last_state(connection: sa.Connection, event: Event) -> str | None:
    """Return the state of a watcher's last event on the condition of `event`, None without any."""
    same = [EVENTS.c[name] == getattr(event, name) for name in ("watcher", "kind", "unit", "subject")]
    query = sa.select(EVENTS.c.state).where(*same).order_by(EVENTS.c.id.desc()).limit(1)
    return connection.execute(query).scalar()


def _moment(time: str) -> str:
    """Return a time as text for the comparison with stored times: in UTC, with or without a fraction."""
    try:
        moment = datetime.fromisoformat(time)
        moment = moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)
    except (ValueError, OverflowError):  # in UTC it may lie before the year 1, or after 9999
        raise HistoryError(
            f"'{time}' is no time; give one like 2026-03-01 or 2026-03-01T10:00:00+01:00"
        ) from None
    return moment.replace(tzinfo=None).isoformat()


def _event(row: "sa.Row[Any]") -> Event:
    values = row._asdict()
    del values["key"]
    return Event(**values | {"details": json.loads(values["details"]), "number": values.pop("id")})
