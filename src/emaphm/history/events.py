"""Events: what became known of a unit, or of the watching itself, at a moment; each is in a history once."""

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
"""What an event may be on; docs/monitoring.md says when each is raised."""

STATES = ("raised", "cleared")
"""A condition begins, or ends. An event that has no end, such as a change of health, is raised only."""

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
"""The kinds that are raised and later cleared."""


@dataclass(frozen=True)
class Event:
    """One event; what a database cannot hold of its texts is written with escapes.

    Attributes
    ----------
    kind, state, severity
        Of `KINDS`, `STATES` and `SEVERITIES`.
    message
        A sentence.
    subject
        What a condition is on, within its unit and kind: a component, a channel; empty where there is one.
    unit, hours
        Serial number and flight hours [h]; None where the event is on no unit.
    recording, recording_hash
        Name and SHA-256 of the recording that it comes from.
    details
        Further values, ready for JSON.
    watcher
        Which watcher made it (`emaphm.monitoring`), empty for another source.
    at
        Time at which it was made, UTC, ISO 8601.
    number
        Its place in the history, rising; None before it is there.

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
        # Here, so that its key and its condition are the same before it is in a history and after.
        for one in fields(self):
            if isinstance(text := getattr(self, one.name), str):
                object.__setattr__(self, one.name, storable(text))

    @property
    def key(self) -> str:
        """What makes it the same event.

        Of one that comes from a recording, all but its words and its time; from a file (`file_sha256` of its
        details), all but its time. One that a prognosis makes (`made_from` of its details) is another where
        more was known.
        """
        file = self.details.get("file_sha256")
        origin = self.recording_hash or f"{file or self.at} {self.message}"
        if "made_from" in self.details:
            origin += f" {json.dumps(self.details['made_from'], sort_keys=True)}"
        parts = (self.watcher, self.kind, self.state, self.unit, self.subject, origin)
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:32]

    @property
    def condition(self) -> tuple[str | None, str, str]:
        """What its state is of: unit, kind and subject."""
        return self.unit, self.kind, self.subject

    def to_dict(self) -> dict[str, Any]:
        """Return the event as a line of `emaphm watch`, and as what a webhook is sent."""
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
    """Add events in their order, those that are there already left out; return how many are new.

    There already is also what says of a watcher's own condition what its last event says: two processes of a
    watcher see the same folder vanish, each at a time of its own.
    """
    new = 0
    for one in events:
        if connection.execute(sa.select(EVENTS.c.id).where(EVENTS.c.key == one.key)).first():
            continue
        if one.unit is None and one.kind in CONDITION_KINDS and _last_state(connection, one) == one.state:
            continue
        row = {
            name: getattr(one, name)
            for name in EVENTS.columns.keys()  # noqa: SIM118 - of a collection that is no dict
            if name not in {"id", "details"}
        }
        connection.execute(EVENTS.insert().values(row | {"details": json.dumps(finite(dict(one.details)))}))
        new += 1
    return new


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
    """Return events as `History.events` does; `watcher` asks for those that one watcher made.

    `recording_hash` for those that come from one recording, `before` for those of lower numbers; the first
    `offset` are left out.
    """
    query = sa.select(EVENTS).where(*_of(unit, kinds))
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
    """Return how many events there are, of a unit or of all, of these kinds or of all where empty."""
    query = sa.select(sa.func.count()).select_from(EVENTS).where(*_of(unit, kinds))
    return int(connection.execute(query).scalar_one())


def _of(unit: str | None, kinds: Sequence[str]) -> list[sa.ColumnElement[bool]]:
    """Return the conditions of a unit and of kinds."""
    of_unit = [] if unit is None else [EVENTS.c.unit == unit]
    return [*of_unit, *([EVENTS.c.kind.in_(kinds)] if kinds else [])]


def read_open_conditions(connection: sa.Connection, unit: str | None = None) -> tuple[Event, ...]:
    """Return the last event of each condition that was raised and not cleared, in their order.

    Those on no unit are a watcher's own: what one of two sees again may still be lost to the other.
    """
    last = sa.select(sa.func.max(EVENTS.c.id)).where(EVENTS.c.kind.in_(CONDITION_KINDS))
    if unit is not None:
        last = last.where(EVENTS.c.unit == unit)
    owner = sa.case((EVENTS.c.unit.is_(None), EVENTS.c.watcher), else_="")
    last = last.group_by(EVENTS.c.unit, EVENTS.c.kind, EVENTS.c.subject, owner)
    query = sa.select(EVENTS).where(EVENTS.c.id.in_(last), EVENTS.c.state == "raised").order_by(EVENTS.c.id)
    return tuple(_event(row) for row in connection.execute(query))


def _last_state(connection: sa.Connection, event: Event) -> str | None:
    """Return the state of a watcher's last event on the condition of `event`, None where there is none."""
    same = [EVENTS.c[name] == getattr(event, name) for name in ("watcher", "kind", "unit", "subject")]
    query = sa.select(EVENTS.c.state).where(*same).order_by(EVENTS.c.id.desc()).limit(1)
    return connection.execute(query).scalar()


def _moment(time: str) -> str:
    """Return what kept times are compared with as text: in UTC, to the second or with its fraction."""
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
