"""Withdrawal of wrong entries from a history; their content and the reason are kept on record.

A withdrawn entry is deleted from the tables of entries, so that it is not used anywhere.
"""

import json
from pathlib import PurePath
from typing import Any

import sqlalchemy as sa

from emaphm.errors import HistoryError
from emaphm.history.reading import UnitRow
from emaphm.history.records import Mistake, Withdrawal
from emaphm.history.storage.diagnosis_row import unpacked
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
"""Least number of characters of a recording's SHA-256 that may name it."""


def withdraw(connection: sa.Connection, unit: UnitRow, mistake: Mistake) -> Withdrawal:
    """Withdraw an entry, and put it on record with the reason.

    A flight is deleted with its last recording, and a unit with its last flight. The curves of the unit's
    last prognosis are deleted too, because they and their earlier forecasts may depend on the entry.

    Raises
    ------
    HistoryError
        There is no such entry, there are several, or removals and findings of the unit would be left without
        a recording.
    """
    row = _row_of(connection, unit, mistake)
    entry = _values(row)
    connection.execute(PROGNOSIS_CURVES.delete().where(PROGNOSIS_CURVES.c.unit_id == unit.id))
    if mistake.kind == "recording":
        _check_last(connection, unit, row["id"])
        entry["diagnoses"] = _diagnoses(connection, row["id"])
        _delete_recording(connection, unit, row)
    else:
        table = REMOVALS if mistake.kind == "removal" else FINDINGS
        connection.execute(table.delete().where(table.c.id == row["id"]))
    withdrawal = Withdrawal(
        mistake.kind, row["hours"], _subject(row), mistake.reason, timestamp(), dict(finite(entry))
    )
    connection.execute(
        WITHDRAWALS.insert().values(
            serial_number=unit.serial_number,
            kind=withdrawal.kind,
            hours=withdrawal.hours,
            subject=withdrawal.subject,
            reason=withdrawal.reason,
            document=json.dumps(withdrawal.entry),
            at=withdrawal.at,
        )
    )
    return withdrawal


def read_withdrawals(connection: sa.Connection, serial_number: str) -> tuple[Withdrawal, ...]:
    """Return the withdrawals of a serial number in their order, also from before its unit was added again."""
    query = (
        sa.select(WITHDRAWALS).where(WITHDRAWALS.c.serial_number == serial_number).order_by(WITHDRAWALS.c.id)
    )
    return tuple(
        Withdrawal(row.kind, row.hours, row.subject, row.reason, row.at, json.loads(row.document))
        for row in connection.execute(query)
    )


def _row_of(connection: sa.Connection, unit: UnitRow, mistake: Mistake) -> sa.RowMapping:
    """Return the row of the entry that `mistake` names."""
    rows = connection.execute(_entries(mistake.kind, unit)).mappings().all()
    # Texts show nine digits: hours with more digits are also found by these.
    shown = f"{mistake.hours:.9g}"
    at_hours = [row for row in rows if row["hours"] == mistake.hours] or [
        row for row in rows if f"{row['hours']:.9g}" == shown
    ]
    place = f"unit '{unit.serial_number}' at {shown} h"
    if not at_hours:
        hours = sorted(
            {row["hours"] for row in rows}, key=lambda hours_of_entry: abs(hours_of_entry - mistake.hours)
        )[:3]
        known = ", ".join(f"{hours_of_entry:.9g} h" for hours_of_entry in hours)
        hint = f"; the nearest are at {known}" if hours else ", nor at other hours"
        raise HistoryError(f"{place}: no {mistake.kind} there{hint}")
    names = ", ".join(_title(row) for row in at_hours)
    matching = [row for row in at_hours if mistake.which is None or _is_called(row, mistake.which)]
    if not matching:
        raise HistoryError(f"{place}: no {mistake.kind} '{mistake.which}' there, but {names}")
    if len(matching) > 1:
        raise HistoryError(f"{place}: there are {names}; name the entry with --which")
    return matching[0]


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
    """Return the name of an entry among entries at the same hours."""
    return str(row.get("name") or row.get("component") or row["reason"])


def _title(row: sa.RowMapping) -> str:
    """Return an unambiguous title of an entry."""
    return f"'{_subject(row)}'" + (f" ({row['hash'][:SHORTEST_HASH]})" if "hash" in row else "")


def _is_called(row: sa.RowMapping, which: str) -> bool:
    """Return whether `which` names an entry: by its subject, file name or the start of its hash."""
    by_hash = len(which) >= SHORTEST_HASH and str(row.get("hash", "")).startswith(which.lower())
    return which in (_subject(row), PurePath(_subject(row)).name) or by_hash


def _check_last(connection: sa.Connection, unit: UnitRow, recording_id: int) -> None:
    """Refuse to delete the last recording of a unit with removals or findings."""
    other_recordings = (
        sa.select(RECORDINGS.c.id)
        .join(FLIGHTS, FLIGHTS.c.id == RECORDINGS.c.flight_id)
        .where(FLIGHTS.c.unit_id == unit.id, RECORDINGS.c.id != recording_id)
    )
    if _any(connection, other_recordings):
        return
    for table, kind in ((REMOVALS, "removals"), (FINDINGS, "findings")):
        if _any(connection, sa.select(table.c.id).where(table.c.unit_id == unit.id)):
            raise HistoryError(
                f"this is the only recording of unit '{unit.serial_number}', which has {kind}; withdraw "
                "these first, then the recording, which also deletes the unit"
            )


def _delete_recording(connection: sa.Connection, unit: UnitRow, row: sa.RowMapping) -> None:
    """Delete a recording with its diagnoses, and a flight or a unit without another recording."""
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
    """Return all stored diagnoses of a recording, with the hash of their description."""
    query = (
        sa.select(DIAGNOSES, DESCRIPTIONS.c.hash.label("description"))
        .join(DESCRIPTIONS, DESCRIPTIONS.c.id == DIAGNOSES.c.description_id)
        .where(DIAGNOSES.c.recording_id == recording_id)
        .order_by(DIAGNOSES.c.id)
    )
    diagnoses = [_values(row) for row in connection.execute(query).mappings()]
    return [
        diagnosis | {name: json.loads(diagnosis[name]) for name in ("coordinates", "document")}
        for diagnosis in diagnoses
    ]


def _values(row: sa.RowMapping) -> dict[str, Any]:
    """Return the values of a row for JSON, without ids, which have no meaning after the deletion."""
    return {
        str(name): unpacked(value).tolist() if isinstance(value, bytes) else value
        for name, value in row.items()
        if name != "id" and not str(name).endswith("_id")
    }
