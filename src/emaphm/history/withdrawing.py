"""Taking out of a history what was entered wrongly; what it was, and why it went, stays on record.

An entry that is withdrawn leaves the tables that everything else reads, so that it counts nowhere.
"""

import json
from pathlib import PurePath
from typing import Any

import sqlalchemy as sa

from emaphm.errors import HistoryError
from emaphm.history.columns import unpacked
from emaphm.history.reading import UnitRow
from emaphm.history.records import Mistake, Withdrawal
from emaphm.history.storage.tables import (
    DESCRIPTIONS,
    DIAGNOSES,
    FINDINGS,
    FLIGHTS,
    PROGNOSES,
    PROGNOSIS_CURVES,
    RECORDINGS,
    REMOVALS,
    UNITS,
    WITHDRAWALS,
)
from emaphm.history.timestamp import timestamp
from emaphm.strict_json import finite

SHORTEST_HASH = 8
"""Characters by which a recording's SHA-256 may be named."""


def withdraw(connection: sa.Connection, unit: UnitRow, mistake: Mistake) -> Withdrawal:
    """Take an entry out, and put it on record with the reason.

    A flight goes with its last recording, and a unit with its last flight. The curves of the unit's last
    prognosis go too: they and their earlier forecasts may follow from the entry.

    Raises
    ------
    HistoryError
        There is no such entry, there are several, or removals and findings of the unit would be left alone.
    """
    row = _found(connection, unit, mistake)
    entry = _values(row)
    connection.execute(PROGNOSIS_CURVES.delete().where(PROGNOSIS_CURVES.c.unit_id == unit.id))
    if mistake.kind == "recording":
        _check_last(connection, unit, row["id"])
        entry["diagnoses"] = _diagnoses(connection, row["id"])
        _delete_recording(connection, unit, row)
    else:
        table = REMOVALS if mistake.kind == "removal" else FINDINGS
        connection.execute(table.delete().where(table.c.id == row["id"]))
    made = Withdrawal(
        mistake.kind, mistake.hours, _subject(row), mistake.reason, timestamp(), dict(finite(entry))
    )
    connection.execute(
        WITHDRAWALS.insert().values(
            serial_number=unit.serial_number,
            kind=made.kind,
            hours=made.hours,
            subject=made.subject,
            reason=made.reason,
            document=json.dumps(made.entry),
            at=made.at,
        )
    )
    return made


def read_withdrawals(connection: sa.Connection, serial_number: str) -> tuple[Withdrawal, ...]:
    """Return what was withdrawn of a serial number, in that order, also before its unit was added again."""
    query = (
        sa.select(WITHDRAWALS).where(WITHDRAWALS.c.serial_number == serial_number).order_by(WITHDRAWALS.c.id)
    )
    return tuple(
        Withdrawal(row.kind, row.hours, row.subject, row.reason, row.at, json.loads(row.document))
        for row in connection.execute(query)
    )


def _found(connection: sa.Connection, unit: UnitRow, mistake: Mistake) -> sa.RowMapping:
    """Return the row of the entry that is meant."""
    rows = connection.execute(_entries(mistake.kind, unit)).mappings().all()
    there = [row for row in rows if row["hours"] == mistake.hours]
    where = f"unit '{unit.serial_number}' at {mistake.hours:.9g} h"
    if not there:
        hours = sorted({row["hours"] for row in rows}, key=lambda one: abs(one - mistake.hours))[:3]
        known = ", ".join(f"{one:.9g} h" for one in hours)
        hint = f"; the nearest are at {known}" if hours else ", nor at other hours"
        raise HistoryError(f"{where}: no {mistake.kind} there{hint}")
    names = ", ".join(_title(row) for row in there)
    meant = [row for row in there if mistake.which is None or _is_called(row, mistake.which)]
    if not meant:
        raise HistoryError(f"{where}: no {mistake.kind} '{mistake.which}' there, but {names}")
    if len(meant) > 1:
        raise HistoryError(f"{where}: there are {names}; say by --which which of them")
    return meant[0]


def _entries(kind: str, unit: UnitRow) -> sa.Select[Any]:
    """Return the query of a unit's entries of a kind, each with its hours."""
    if kind == "recording":
        of_flight = (FLIGHTS.c[name] for name in ("hours", "cycles", "position", "load", "temperature"))
        return (
            sa.select(RECORDINGS, *of_flight)
            .join(FLIGHTS, FLIGHTS.c.id == RECORDINGS.c.flight_id)
            .where(FLIGHTS.c.unit_id == unit.id)
            .order_by(RECORDINGS.c.id)
        )
    table = REMOVALS if kind == "removal" else FINDINGS
    return sa.select(table).where(table.c.unit_id == unit.id).order_by(table.c.id)


def _subject(row: sa.RowMapping) -> str:
    """Return what an entry is called among others of its hours."""
    return str(row.get("name") or row.get("component") or row["reason"])


def _title(row: sa.RowMapping) -> str:
    """Return how to name an entry so that no other is meant."""
    return f"'{_subject(row)}'" + (f" ({row['hash'][:SHORTEST_HASH]})" if "hash" in row else "")


def _is_called(row: sa.RowMapping, which: str) -> bool:
    by_hash = len(which) >= SHORTEST_HASH and str(row.get("hash", "")).startswith(which.lower())
    return which in (_subject(row), PurePath(_subject(row)).name) or by_hash


def _check_last(connection: sa.Connection, unit: UnitRow, recording_id: int) -> None:
    """Refuse to leave removals or findings of a unit that has no recording."""
    others = (
        sa.select(RECORDINGS.c.id)
        .join(FLIGHTS, FLIGHTS.c.id == RECORDINGS.c.flight_id)
        .where(FLIGHTS.c.unit_id == unit.id, RECORDINGS.c.id != recording_id)
    )
    if _any(connection, others):
        return
    for table, what in ((REMOVALS, "removals"), (FINDINGS, "findings")):
        if _any(connection, sa.select(table.c.id).where(table.c.unit_id == unit.id)):
            raise HistoryError(
                f"this is the only recording of unit '{unit.serial_number}', which has {what} too; withdraw "
                "these first, then it, and the unit goes with it"
            )


def _delete_recording(connection: sa.Connection, unit: UnitRow, row: sa.RowMapping) -> None:
    """Delete a recording with its diagnoses, and a flight or a unit that has no other."""
    connection.execute(DIAGNOSES.delete().where(DIAGNOSES.c.recording_id == row["id"]))
    connection.execute(RECORDINGS.delete().where(RECORDINGS.c.id == row["id"]))
    if _any(connection, sa.select(RECORDINGS.c.id).where(RECORDINGS.c.flight_id == row["flight_id"])):
        return
    connection.execute(FLIGHTS.delete().where(FLIGHTS.c.id == row["flight_id"]))
    if _any(connection, sa.select(FLIGHTS.c.id).where(FLIGHTS.c.unit_id == unit.id)):
        return
    connection.execute(PROGNOSES.delete().where(PROGNOSES.c.unit_id == unit.id))
    connection.execute(UNITS.delete().where(UNITS.c.id == unit.id))


def _any(connection: sa.Connection, query: sa.Select[Any]) -> bool:
    return connection.execute(query.limit(1)).first() is not None


def _diagnoses(connection: sa.Connection, recording_id: int) -> list[dict[str, Any]]:
    """Return all diagnoses of a recording as they are kept, with the hash of their description."""
    query = (
        sa.select(DIAGNOSES, DESCRIPTIONS.c.hash.label("description"))
        .join(DESCRIPTIONS, DESCRIPTIONS.c.id == DIAGNOSES.c.description_id)
        .where(DIAGNOSES.c.recording_id == recording_id)
        .order_by(DIAGNOSES.c.id)
    )
    held = [_values(row) for row in connection.execute(query).mappings()]
    return [one | {name: json.loads(one[name]) for name in ("coordinates", "document")} for one in held]


def _values(row: sa.RowMapping) -> dict[str, Any]:
    """Return what a row holds, for JSON; numbers of rows say nothing once they are gone."""
    return {
        str(name): unpacked(value).tolist() if isinstance(value, bytes) else value
        for name, value in row.items()
        if name != "id" and not str(name).endswith("_id")
    }
