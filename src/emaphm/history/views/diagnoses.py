"""Diagnoses of all units as summary lines, newest first, and a single full diagnosis."""

import json
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa

from emaphm.actuator.faults import degraded_in, health_in
from emaphm.history.kept_diagnosis import KeptDiagnosis
from emaphm.history.reading import UnitRow, flights
from emaphm.history.storage.diagnosis_row import diagnosis_of
from emaphm.history.storage.tables import DESCRIPTIONS, DIAGNOSES, FLIGHTS, RECORDINGS, UNITS


@dataclass(frozen=True)
class DiagnosisLine:
    """Summary of a diagnosis with its recording; `degraded` has the components with this verdict.

    `health` is one of `emaphm.actuator.faults.HEALTHS`; `samples`, `sample_rate_hz` [Hz] are the recording's;
    `sensor_faults` and `reasons` are sentences.
    """

    id: int
    unit_id: int
    unit: str
    part_number: str
    hours: float
    cycles: int | None
    recording: str
    recording_hash: str
    samples: int
    sample_rate_hz: float
    explained: bool
    health: str
    degraded: tuple[str, ...]
    reasons: tuple[str, ...]
    sensor_faults: tuple[str, ...]
    added_at: str


def diagnosis_lines(
    connection: sa.Connection,
    *,
    unit_id: int | None = None,
    explained: bool | None = None,
    before: int | None = None,
    offset: int = 0,
    limit: int = 100,
) -> tuple[DiagnosisLine, ...]:
    """Return the last diagnosis of each recording that meets all conditions, newest first.

    Parameters
    ----------
    connection
        Connection that reads the history.
    unit_id
        Id of the unit; by default all units.
    explained
        True for explained diagnoses only, False for unexplained ones only; by default all.
    before
        Id of a diagnosis; only older diagnoses are returned.
    offset
        Number of the newest diagnoses that are left out.
    limit
        Largest number of diagnoses.
    """
    query = _joined(
        DIAGNOSES.c.id,
        DIAGNOSES.c.explained,
        DIAGNOSES.c.document,
        DIAGNOSES.c.added_at,
        UNITS.c.id.label("unit_id"),
        UNITS.c.serial_number,
        UNITS.c.part_number,
        FLIGHTS.c.hours,
        FLIGHTS.c.cycles,
        RECORDINGS.c.name,
        RECORDINGS.c.hash,
        RECORDINGS.c.samples,
        RECORDINGS.c.sample_rate_hz,
    ).where(DIAGNOSES.c.id == last_of_recording())
    if unit_id is not None:
        query = query.where(UNITS.c.id == unit_id)
    if explained is not None:
        query = query.where(DIAGNOSES.c.explained == explained)
    if before is not None:
        query = query.where(DIAGNOSES.c.id < before)
    rows = connection.execute(query.order_by(DIAGNOSES.c.id.desc()).offset(offset).limit(limit))
    return tuple(_line(row) for row in rows)


def last_of_recording() -> sa.ScalarSelect[int]:
    """Return the subquery of the id of the last diagnosis of the recording in the query around it."""
    of_recording = DIAGNOSES.alias()
    return (
        sa.select(sa.func.max(of_recording.c.id))
        .where(of_recording.c.recording_id == RECORDINGS.c.id)
        .scalar_subquery()
    )


def diagnosis(connection: sa.Connection, diagnosis_id: int) -> tuple[UnitRow, KeptDiagnosis, str] | None:
    """Return unit, diagnosis and TOML of its description for `diagnosis_id`, None for an unknown id.

    `connection` reads the history.
    """
    query = _joined(
        DIAGNOSES,
        FLIGHTS.c.hours,
        UNITS.c.id.label("unit_id"),
        UNITS.c.serial_number,
        UNITS.c.part_number,
        RECORDINGS.c.hash.label("recording_hash"),
        RECORDINGS.c.name.label("recording_name"),
        DESCRIPTIONS.c.hash.label("description_hash"),
        DESCRIPTIONS.c.toml,
    ).join(DESCRIPTIONS, DESCRIPTIONS.c.id == DIAGNOSES.c.description_id)
    row = connection.execute(query.where(DIAGNOSES.c.id == diagnosis_id)).one_or_none()
    if row is None:
        return None
    flight = next(flight for flight in flights(connection, row.unit_id) if flight.hours == row.hours)
    unit = UnitRow(row.unit_id, row.serial_number, row.part_number)
    return unit, diagnosis_of(row, flight), row.toml


def last_diagnosis(connection: sa.Connection, recording_hash: str) -> int | None:
    """Return the id of the last diagnosis of the recording with this hash, None without any.

    `connection` reads the history; the hash is `DiagnosisLine.recording_hash`.
    """
    query = (
        sa.select(sa.func.max(DIAGNOSES.c.id))
        .join(RECORDINGS, RECORDINGS.c.id == DIAGNOSES.c.recording_id)
        .where(RECORDINGS.c.hash == recording_hash)
    )
    return connection.execute(query).scalar()


def _joined(*columns: Any) -> sa.Select[Any]:
    """Return the query of `columns` of diagnoses with their recordings, flights and units."""
    return (
        sa.select(*columns)
        .select_from(DIAGNOSES)
        .join(RECORDINGS, RECORDINGS.c.id == DIAGNOSES.c.recording_id)
        .join(FLIGHTS, FLIGHTS.c.id == RECORDINGS.c.flight_id)
        .join(UNITS, UNITS.c.id == FLIGHTS.c.unit_id)
    )


def _line(row: "sa.Row[Any]") -> DiagnosisLine:
    """Return the summary line of a row."""
    document = json.loads(row.document)
    return DiagnosisLine(
        id=row.id,
        unit_id=row.unit_id,
        unit=row.serial_number,
        part_number=row.part_number,
        hours=row.hours,
        cycles=row.cycles,
        recording=row.name,
        recording_hash=row.hash,
        samples=row.samples,
        sample_rate_hz=row.sample_rate_hz,
        explained=row.explained,
        health=health_in(document),
        degraded=degraded_in(document),
        reasons=tuple(document.get("reasons", ())),
        sensor_faults=tuple(fault["sentence"] for fault in document.get("sensor_faults", ())),
        added_at=row.added_at,
    )
