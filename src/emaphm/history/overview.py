"""A line on each unit of a history."""

from dataclasses import dataclass

import sqlalchemy as sa

from emaphm.history.reading import UnitRow, units
from emaphm.history.storage.tables import DIAGNOSES, FLIGHTS, RECORDINGS


@dataclass(frozen=True)
class Overview:
    """A unit's latest hours [h] and cycles, how many recordings it has, and how many of them are explained.

    `document` is the JSON of the last diagnosis of its last flight.
    """

    unit: UnitRow
    hours: float
    cycles: int | None
    recordings: int
    explained: int
    document: str


def overviews(connection: sa.Connection, part_number: str | None = None) -> tuple[Overview, ...]:
    """Return a line on each unit, or on those of a part number, in three passes over the history."""
    flown, counted, last = _flown(connection), _counted(connection), _last_documents(connection)
    return tuple(
        Overview(one, *flown[one.id], *counted[one.id], last[one.id])
        for one in units(connection)
        if part_number in (None, one.part_number)
    )


def _flown(connection: sa.Connection) -> dict[int, tuple[float, int | None]]:
    """Return the latest hours and cycles by unit."""
    query = sa.select(
        FLIGHTS.c.unit_id, sa.func.max(FLIGHTS.c.hours), sa.func.max(FLIGHTS.c.cycles)
    ).group_by(FLIGHTS.c.unit_id)
    return {unit_id: (hours, cycles) for unit_id, hours, cycles in connection.execute(query)}


def _counted(connection: sa.Connection) -> dict[int, tuple[int, int]]:
    """Return by unit how many recordings it has, and of how many the last diagnosis explains them."""
    ranked = _ranked()
    query = (
        sa.select(ranked.c.unit_id, sa.func.count(), sa.func.sum(sa.case((ranked.c.explained, 1), else_=0)))
        .where(ranked.c.of_recording == 1)
        .group_by(ranked.c.unit_id)
    )
    return {unit_id: (recordings, explained) for unit_id, recordings, explained in connection.execute(query)}


def _last_documents(connection: sa.Connection) -> dict[int, str]:
    """Return the JSON of the last diagnosis of each unit's last flight."""
    ranked = _ranked()
    query = (
        sa.select(ranked.c.unit_id, DIAGNOSES.c.document)
        .join(DIAGNOSES, DIAGNOSES.c.id == ranked.c.id)
        .where(ranked.c.of_unit == 1)
    )
    return {row.unit_id: row.document for row in connection.execute(query)}


def _ranked() -> sa.Subquery:
    """Return the diagnoses, each with its rank among its recording's and its unit's; 1 is the last."""
    of_recording = sa.func.row_number().over(partition_by=RECORDINGS.c.id, order_by=DIAGNOSES.c.id.desc())
    latest = (FLIGHTS.c.hours.desc(), DIAGNOSES.c.id.desc())
    of_unit = sa.func.row_number().over(partition_by=FLIGHTS.c.unit_id, order_by=latest)
    return (
        sa.select(
            FLIGHTS.c.unit_id,
            DIAGNOSES.c.id,
            DIAGNOSES.c.explained,
            of_recording.label("of_recording"),
            of_unit.label("of_unit"),
        )
        .join(RECORDINGS, RECORDINGS.c.id == DIAGNOSES.c.recording_id)
        .join(FLIGHTS, FLIGHTS.c.id == RECORDINGS.c.flight_id)
        .subquery()
    )
