"""Reading of entries from a history; each function reads one consistent state."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa

from emaphm.errors import HistoryError, nearest
from emaphm.history.kept_diagnosis import KeptDiagnosis, KeptSettings
from emaphm.history.records import Finding, Flight, Removal
from emaphm.history.storage.diagnosis_row import diagnosis_of
from emaphm.history.storage.tables import (
    DESCRIPTIONS,
    DIAGNOSES,
    FINDINGS,
    FLIGHTS,
    RECORDINGS,
    REMOVALS,
    UNITS,
)


@dataclass(frozen=True)
class UnitRow:
    """A row of `UNITS`."""

    id: int
    serial_number: str
    part_number: str


def units(connection: sa.Connection) -> tuple[UnitRow, ...]:
    """Return all units, by part and serial number."""
    rows = connection.execute(_units().order_by(UNITS.c.part_number, UNITS.c.serial_number))
    return tuple(UnitRow(*row) for row in rows)


def unit_or_none(connection: sa.Connection, serial_number: str) -> UnitRow | None:
    """Return a unit by its serial number, None if it is not in the history."""
    row = connection.execute(_units().where(UNITS.c.serial_number == serial_number)).one_or_none()
    return UnitRow(*row) if row else None


def unit(connection: sa.Connection, serial_number: str) -> UnitRow:
    """Return a unit by its serial number; an unknown one raises `HistoryError` with the nearest."""
    row = unit_or_none(connection, serial_number)
    if row is None:
        known = connection.execute(sa.select(UNITS.c.serial_number)).scalars().all()
        hint = nearest(serial_number, known) if known else "; the history is empty"
        raise HistoryError(f"no unit '{serial_number}' in the history{hint}")
    return row


def flights(connection: sa.Connection, unit_id: int) -> tuple[Flight, ...]:
    """Return a unit's flights by hours.

    A missing position is that of the previous flight, unless the unit was removed in between.
    """
    removed = (
        connection.execute(sa.select(REMOVALS.c.hours).where(REMOVALS.c.unit_id == unit_id)).scalars().all()
    )
    rows = connection.execute(
        sa.select(
            FLIGHTS.c.hours, FLIGHTS.c.cycles, FLIGHTS.c.position, FLIGHTS.c.load, FLIGHTS.c.temperature
        )
        .where(FLIGHTS.c.unit_id == unit_id)
        .order_by(FLIGHTS.c.hours)
    )
    result: list[Flight] = []
    for hours, cycles, position, load, temperature in rows:
        previous = result[-1] if result else None
        if (
            position is None
            and previous
            and not any(previous.hours <= removal < hours for removal in removed)
        ):
            result.append(Flight(hours, cycles, previous.position, load, temperature))
        else:
            result.append(Flight(hours, cycles, position, load, temperature))
    return tuple(result)


def diagnoses(
    connection: sa.Connection, unit_id: int, latest: int | None = None, earlier: int = 0
) -> tuple[KeptDiagnosis, ...]:
    """Return the last diagnosis of each of a unit's recordings, by hours and then in the order of addition.

    `latest` limits their number to those with most hours; at most `earlier` diagnoses before them are added.
    """
    of_hours = {flight.hours: flight for flight in flights(connection, unit_id)}
    newest = (
        sa.select(sa.func.max(DIAGNOSES.c.id))
        .join(RECORDINGS, RECORDINGS.c.id == DIAGNOSES.c.recording_id)
        .join(FLIGHTS, FLIGHTS.c.id == RECORDINGS.c.flight_id)
        .where(FLIGHTS.c.unit_id == unit_id)
        .group_by(RECORDINGS.c.id, FLIGHTS.c.hours)
    )
    ids_or_query: Sequence[int] | sa.Select[Any] = newest
    if latest is not None:
        ordered = newest.order_by(FLIGHTS.c.hours.desc(), RECORDINGS.c.id.desc())
        ids = connection.execute(ordered if earlier else ordered.limit(latest)).scalars().all()
        ids_or_query = [*ids[:latest], *_spread(ids[: latest - 1 : -1] if latest else ids[::-1], earlier)]
    chosen = _diagnoses().where(DIAGNOSES.c.id.in_(ids_or_query)).order_by(FLIGHTS.c.hours, RECORDINGS.c.id)
    return tuple(diagnosis_of(row, of_hours[row.hours]) for row in connection.execute(chosen))


def _spread(ids: Sequence[int], most: int) -> Sequence[int]:
    """Return at most `most` of the `ids`, every 2nd, 4th, 8th …: a stable selection as ids are appended."""
    step = 1
    while len(ids) > most * step > 0:
        step *= 2
    return ids[::step] if most else ()


def latest_entry(connection: sa.Connection, unit_id: int) -> tuple[float, str]:
    """Return a unit's latest hours [h] and the entry with these hours: a recording, removal or finding."""
    entries = (
        (FLIGHTS.c.hours, sa.literal("recording"), FLIGHTS.c.unit_id),
        (REMOVALS.c.hours, sa.literal("removal"), REMOVALS.c.unit_id),
        (FINDINGS.c.hours, sa.literal("finding on ") + FINDINGS.c.component, FINDINGS.c.unit_id),
    )
    rows = [
        connection.execute(
            sa.select(hours, kind).where(unit == unit_id).order_by(hours.desc()).limit(1)
        ).one_or_none()
        for hours, kind, unit in entries
    ]
    hours, kind = max((row for row in rows if row is not None), key=lambda row: row[0], default=(0.0, ""))
    return float(hours), str(kind)


def hours_last_added(connection: sa.Connection, unit_id: int, count: int) -> tuple[float, ...]:
    """Return the hours [h] of the last `count` recordings added to a unit, in the order of addition."""
    query = (
        sa.select(FLIGHTS.c.hours)
        .join(RECORDINGS, RECORDINGS.c.flight_id == FLIGHTS.c.id)
        .where(FLIGHTS.c.unit_id == unit_id)
        .order_by(RECORDINGS.c.id.desc())
        .limit(count)
    )
    return tuple(connection.execute(query).scalars())[::-1]


def has_diagnosis(connection: sa.Connection, recording_hash: str, settings: KeptSettings) -> bool:
    """Return whether a recording has a diagnosis with these settings."""
    # Its document is not read, because a watcher checks each recording.
    query = _diagnoses().with_only_columns(DIAGNOSES.c.id).where(*_made_by(recording_hash, settings))
    return connection.execute(query).first() is not None


def diagnosis(
    connection: sa.Connection, recording_hash: str, settings: Sequence[KeptSettings]
) -> KeptDiagnosis | None:
    """Return the last diagnosis of a recording with one of several settings, None without any."""
    by_any = sa.or_(*(sa.and_(*_made_by(recording_hash, setting)) for setting in settings))
    query = _diagnoses().add_columns(FLIGHTS.c.unit_id).where(by_any).order_by(DIAGNOSES.c.id.desc())
    row = connection.execute(query.limit(1)).one_or_none()
    if row is None:
        return None
    flight_by_hours = {flight.hours: flight for flight in flights(connection, row.unit_id)}
    return diagnosis_of(row, flight_by_hours[row.hours])


def _diagnoses() -> sa.Select[Any]:
    """Return the query of the columns that `diagnosis_of` needs."""
    return (
        sa.select(
            DIAGNOSES,
            FLIGHTS.c.hours,
            RECORDINGS.c.hash.label("recording_hash"),
            RECORDINGS.c.name.label("recording_name"),
            DESCRIPTIONS.c.hash.label("description_hash"),
        )
        .join(RECORDINGS, RECORDINGS.c.id == DIAGNOSES.c.recording_id)
        .join(FLIGHTS, FLIGHTS.c.id == RECORDINGS.c.flight_id)
        .join(DESCRIPTIONS, DESCRIPTIONS.c.id == DIAGNOSES.c.description_id)
    )


def _made_by(recording_hash: str, settings: KeptSettings) -> tuple[sa.ColumnElement[bool], ...]:
    """Return the conditions of a diagnosis of a recording with these settings."""
    return (
        RECORDINGS.c.hash == recording_hash,
        DESCRIPTIONS.c.hash == settings.description,
        DIAGNOSES.c.method == settings.method,
        DIAGNOSES.c.model == settings.model,
        DIAGNOSES.c.fitness == settings.fitness,
        DIAGNOSES.c.seed == str(settings.seed),
    )


def description(connection: sa.Connection, unit_id: int) -> str | None:
    """Return the actuator TOML of a unit's last diagnosis, None without any."""
    return connection.scalar(_last_description(unit_id))


def other_descriptions(connection: sa.Connection, unit: UnitRow, most: int) -> tuple[str, ...]:
    """Return the TOML of the last diagnosis of up to `most` other units of the part number, in one query."""
    query = (
        sa.select(_last_description(UNITS.c.id).scalar_subquery())
        .where(UNITS.c.part_number == unit.part_number, UNITS.c.id != unit.id)
        .order_by(UNITS.c.id)
        .limit(most)
    )
    return tuple(toml for toml in connection.execute(query).scalars() if toml is not None)


def _last_description(unit_id: int | sa.ColumnElement[int]) -> sa.Select[str]:
    """Return the query of the TOML of a unit's last diagnosis."""
    return (
        sa.select(DESCRIPTIONS.c.toml)
        .join(DIAGNOSES, DIAGNOSES.c.description_id == DESCRIPTIONS.c.id)
        .join(RECORDINGS, RECORDINGS.c.id == DIAGNOSES.c.recording_id)
        .join(FLIGHTS, FLIGHTS.c.id == RECORDINGS.c.flight_id)
        .where(FLIGHTS.c.unit_id == unit_id)
        .order_by(FLIGHTS.c.hours.desc(), DIAGNOSES.c.id.desc())
        .limit(1)
    )


def removals(connection: sa.Connection, unit_id: int) -> tuple[Removal, ...]:
    """Return a unit's removals by hours."""
    query = sa.select(REMOVALS).where(REMOVALS.c.unit_id == unit_id).order_by(REMOVALS.c.hours)
    return tuple(Removal(row.hours, row.reason, row.note) for row in connection.execute(query))


def findings(connection: sa.Connection, unit_id: int) -> tuple[Finding, ...]:
    """Return the shop findings on a unit, by hours and component."""
    query = (
        sa.select(FINDINGS)
        .where(FINDINGS.c.unit_id == unit_id)
        .order_by(FINDINGS.c.hours, FINDINGS.c.component)
    )
    return tuple(
        Finding(row.hours, row.component, row.condition, row.level, row.replaced, row.note)
        for row in connection.execute(query)
    )


def _units() -> sa.Select[Any]:
    return sa.select(UNITS.c.id, UNITS.c.serial_number, UNITS.c.part_number)
