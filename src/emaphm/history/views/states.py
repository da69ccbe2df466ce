"""States of units for the page of a fleet, read for all units or for some."""

import json
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import sqlalchemy as sa

from emaphm.history.basis import Basis, bases
from emaphm.history.storage.tables import (
    DIAGNOSES,
    EVENTS,
    FINDINGS,
    FLIGHTS,
    PROGNOSES,
    RECORDINGS,
    REMOVALS,
    UNITS,
    WITHDRAWALS,
)
from emaphm.history.views.diagnoses import last_of_recording

MOST_ASKED = 500
"""Largest number of units in one query: databases accept no more than some thousand parameters."""


class Marks(NamedTuple):
    """Ids of the newest rows of each kind: if they are equal, nothing was added in between."""

    diagnosis: int
    removal: int
    finding: int
    withdrawal: int
    event: int
    prognoses: tuple[int, int, float, str, int]


NO_PROGNOSES = (0, 0, 0.0, "", 0)
"""Value of `Marks.prognoses` without any prognosis."""


@dataclass(frozen=True)
class UnitState:
    """Present state of a unit.

    Attributes
    ----------
    hours, cycles, position
        Flight hours at its latest entry (flight, removal or finding) [h]; last known cycles, which rise with
        the hours; position on the aircraft. None if unknown.
    last_at
        Time at which its newest recording was added, UTC, ISO 8601.
    recordings, explained
        Number of its recordings, and of those that the last diagnosis explains.
    diagnosis_id, text
        Id and JSON of the last diagnosis of its last flight.
    basis
        Basis of a prognosis that starts now.
    """

    id: int
    serial_number: str
    part_number: str
    hours: float
    cycles: int | None
    position: str | None
    last_at: str
    recordings: int
    explained: int
    diagnosis_id: int
    text: str = field(repr=False)
    basis: Basis

    @cached_property
    def document(self) -> dict[str, Any]:
        """The last diagnosis of its last flight, as printed by `emaphm diagnose --json`."""
        return dict(json.loads(self.text))


def marks(connection: sa.Connection) -> Marks:
    """Return the ids of the newest rows of a history, which `connection` reads."""
    diagnosis, removal, finding, withdrawal, event = (
        connection.execute(sa.select(sa.func.max(table.c.id))).scalar() or 0
        for table in (DIAGNOSES, REMOVALS, FINDINGS, WITHDRAWALS, EVENTS)
    )
    without = Marks(diagnosis, removal, finding, withdrawal, event, NO_PROGNOSES)
    at = PROGNOSES.c.at  # of two simultaneous prognoses, the one started first may be stored last
    minute, second = (sa.cast(sa.func.substr(at, place, 2), sa.Integer) for place in (15, 18))
    count, diagnoses, hours, last, stamps = connection.execute(
        sa.select(
            sa.func.count(),
            sa.func.sum(PROGNOSES.c.diagnoses),
            sa.func.sum(PROGNOSES.c.hours),
            sa.func.max(at),
            sa.func.sum(60 * minute + second),
        )
    ).one()
    if not count:
        return without
    return without._replace(prognoses=(count, int(diagnoses), float(hours), last, int(stamps)))


def changed_units(connection: sa.Connection, since: Marks) -> set[int]:
    """Return the ids of units that have a diagnosis, removal or finding newer than the marks `since`.

    Withdrawals are not checked; they may concern any unit. `connection` reads the history.
    """
    of_diagnoses = (
        sa.select(FLIGHTS.c.unit_id)
        .join(RECORDINGS, RECORDINGS.c.flight_id == FLIGHTS.c.id)
        .join(DIAGNOSES, DIAGNOSES.c.recording_id == RECORDINGS.c.id)
        .where(DIAGNOSES.c.id > since.diagnosis)
    )
    queries = (
        of_diagnoses,
        sa.select(REMOVALS.c.unit_id).where(REMOVALS.c.id > since.removal),
        sa.select(FINDINGS.c.unit_id).where(FINDINGS.c.id > since.finding),
    )
    return {unit_id for query in queries for unit_id in connection.execute(query.distinct()).scalars()}


def states(connection: sa.Connection, units: Collection[int] | None = None) -> dict[int, UnitState]:
    """Return the states, by id, of the units with the ids `units`, or of all units.

    `connection` reads the history. Unknown units are left out.
    """
    if units is None:
        return _states(connection, sa.true())
    ids = sorted(units)
    result: dict[int, UnitState] = {}
    for start in range(0, len(ids), MOST_ASKED):
        result |= _states(connection, UNITS.c.id.in_(ids[start : start + MOST_ASKED]))
    return result


def _states(connection: sa.Connection, chosen: sa.ColumnElement[bool]) -> dict[int, UnitState]:
    """Return the states of the units that meet the condition `chosen`, by id."""
    counted = {row.unit_id: row for row in connection.execute(_counts(chosen))}
    positions = _positions(connection, chosen)
    basis = bases(connection, chosen)
    without_flight = _latest_without_flight(connection, chosen)
    return {
        row.id: UnitState(
            id=row.id,
            serial_number=row.serial_number,
            part_number=row.part_number,
            hours=max(row.hours, without_flight.get(row.id, 0.0)),
            cycles=row.cycles,
            position=positions.get(row.id),
            last_at=counted[row.id].last_at,
            recordings=counted[row.id].recordings,
            explained=counted[row.id].explained,
            diagnosis_id=row.diagnosis_id,
            text=row.document,
            basis=basis[row.id],
        )
        for row in connection.execute(_last(chosen))
    }


def _last(chosen: sa.ColumnElement[bool]) -> sa.Select[Any]:
    """Return the query of each unit's last hours and cycles, and the last diagnosis of its last flight."""
    flights_of_unit = FLIGHTS.alias()
    last_hours, last_cycles = (
        sa.select(sa.func.max(column)).where(flights_of_unit.c.unit_id == UNITS.c.id).scalar_subquery()
        for column in (flights_of_unit.c.hours, flights_of_unit.c.cycles)
    )
    of_flight = DIAGNOSES.alias()
    newest = (
        sa.select(sa.func.max(of_flight.c.id))
        .join(RECORDINGS, RECORDINGS.c.id == of_flight.c.recording_id)
        .where(RECORDINGS.c.flight_id == FLIGHTS.c.id)
        .correlate(FLIGHTS)
        .scalar_subquery()
    )
    return (
        sa.select(
            UNITS.c.id,
            UNITS.c.serial_number,
            UNITS.c.part_number,
            FLIGHTS.c.hours,
            last_cycles.label("cycles"),
            DIAGNOSES.c.id.label("diagnosis_id"),
            DIAGNOSES.c.document,
        )
        .select_from(UNITS)
        .join(FLIGHTS, sa.and_(FLIGHTS.c.unit_id == UNITS.c.id, FLIGHTS.c.hours == last_hours))
        .join(DIAGNOSES, DIAGNOSES.c.id == newest)
        .where(chosen)
    )


def _counts(chosen: sa.ColumnElement[bool]) -> sa.Select[Any]:
    """Return the query of the numbers of recordings of units, and of explained recordings."""
    return (
        sa.select(
            FLIGHTS.c.unit_id,
            sa.func.count().label("recordings"),
            sa.func.sum(sa.case((DIAGNOSES.c.explained, 1), else_=0)).label("explained"),
            sa.func.max(RECORDINGS.c.added_at).label("last_at"),
        )
        .select_from(FLIGHTS)
        .join(UNITS, UNITS.c.id == FLIGHTS.c.unit_id)
        .join(RECORDINGS, RECORDINGS.c.flight_id == FLIGHTS.c.id)
        .join(
            DIAGNOSES,
            sa.and_(DIAGNOSES.c.recording_id == RECORDINGS.c.id, DIAGNOSES.c.id == last_of_recording()),
        )
        .where(chosen)
        .group_by(FLIGHTS.c.unit_id)
    )


def _latest_without_flight(connection: sa.Connection, chosen: sa.ColumnElement[bool]) -> dict[int, float]:
    """Return by unit the latest hours [h] of its removals and findings, for units that have any."""
    latest_hours: dict[int, float] = {}
    for table in (REMOVALS, FINDINGS):
        latest = (
            sa.select(table.c.unit_id, sa.func.max(table.c.hours))
            .join(UNITS, UNITS.c.id == table.c.unit_id)
            .where(chosen)
            .group_by(table.c.unit_id)
        )
        for unit_id, hours in connection.execute(latest):
            latest_hours[unit_id] = max(hours, latest_hours.get(unit_id, 0.0))
    return latest_hours


def _positions(connection: sa.Connection, chosen: sa.ColumnElement[bool]) -> dict[int, str]:
    """Return by unit the position that was given last, except for units removed since."""
    given = (
        sa.select(FLIGHTS.c.unit_id, FLIGHTS.c.hours, FLIGHTS.c.position)
        .join(UNITS, UNITS.c.id == FLIGHTS.c.unit_id)
        .where(chosen, FLIGHTS.c.position.is_not(None))
        .order_by(FLIGHTS.c.hours)
    )
    last = {row.unit_id: row for row in connection.execute(given)}
    removed = (
        sa.select(REMOVALS.c.unit_id, sa.func.max(REMOVALS.c.hours))
        .join(UNITS, UNITS.c.id == REMOVALS.c.unit_id)
        .where(chosen)
        .group_by(REMOVALS.c.unit_id)
    )
    removed_at: dict[int, float] = {row[0]: row[1] for row in connection.execute(removed)}
    return {
        unit_id: row.position for unit_id, row in last.items() if removed_at.get(unit_id, -1.0) < row.hours
    }
