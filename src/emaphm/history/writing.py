"""Writing of entries to a history, with checks against the existing entries.

Every function needs a connection with the exclusive right to write, so that its checks stay valid.
"""

from typing import TYPE_CHECKING, Any

import sqlalchemy as sa

from emaphm.errors import HistoryError
from emaphm.history.reading import UnitRow, has_diagnosis, latest_entry, unit_or_none
from emaphm.history.records import Entry, Finding, Removal
from emaphm.history.storage.diagnosis_row import row_of
from emaphm.history.storage.tables import (
    DESCRIPTIONS,
    DIAGNOSES,
    FINDINGS,
    FLIGHTS,
    RECORDINGS,
    REMOVALS,
    UNITS,
)
from emaphm.history.timestamp import timestamp

if TYPE_CHECKING:
    from emaphm.diagnosis import Diagnosis
    from emaphm.history.kept_diagnosis import KeptSettings
    from emaphm.recording import Recording

WRONG_FLIGHT = (
    "if the history is wrong, withdraw all recordings of those hours with 'emaphm history withdraw' and add "
    "them again"
)
"""Remedy for a value of a flight, which stays as long as the flight has a recording."""


def check_entry(connection: sa.Connection, entry: Entry, recording_hash: str) -> None:
    """Refuse an entry that contradicts the history, `HistoryError`; nothing is written."""
    unit = _unit_of(connection, entry)
    is_known = _has_recording(connection, entry, recording_hash)
    if unit is not None:
        _check_flight(connection, unit, entry, has_new_recording=not is_known)


def check_statement(connection: sa.Connection, entry: Entry) -> None:
    """Refuse an entry that contradicts the history for any recording; errors as `check_entry`."""
    unit = _unit_of(connection, entry)
    if unit is None:
        return
    of_flight = sa.select(FLIGHTS.c.id).where(FLIGHTS.c.unit_id == unit.id, FLIGHTS.c.hours == entry.hours)
    # If the flight exists, the recording may be one that it already has.
    is_new = connection.execute(of_flight).first() is None
    _check_flight(connection, unit, entry, has_new_recording=is_new)


def _unit_of(connection: sa.Connection, entry: Entry) -> UnitRow | None:
    """Return the unit of an entry, None for a new unit; a unit with another part number is refused."""
    unit = unit_or_none(connection, entry.unit)
    if unit is not None and unit.part_number != entry.part_number:
        raise HistoryError(
            f"unit '{entry.unit}' has the part number '{unit.part_number}', the diagnosis is of "
            f"'{entry.part_number}'; check --unit and --actuator, or give --part"
        )
    return unit


def _check_flight(connection: sa.Connection, unit: UnitRow, entry: Entry, *, has_new_recording: bool) -> None:
    """Refuse hours, cycles, load and temperature that contradict the unit's flights."""
    if has_new_recording:
        _check_hours(connection, unit, entry)
    _check_cycles(connection, unit, entry)
    _check_stress(connection, unit, entry)


def _has_recording(connection: sa.Connection, entry: Entry, recording_hash: str) -> bool:
    """Return whether the entry's flight has the recording; a recording of another flight is refused."""
    row = connection.execute(
        sa.select(UNITS.c.serial_number, FLIGHTS.c.hours, FLIGHTS.c.cycles, RECORDINGS.c.name)
        .join(FLIGHTS, FLIGHTS.c.id == RECORDINGS.c.flight_id)
        .join(UNITS, UNITS.c.id == FLIGHTS.c.unit_id)
        .where(RECORDINGS.c.hash == recording_hash)
    ).one_or_none()
    if row is None:
        return False
    if row.serial_number != entry.unit:
        raise HistoryError(
            f"this recording is in the history already, as '{row.name}' of unit '{row.serial_number}'; it "
            f"cannot be of '{entry.unit}' too, check --unit; withdraw a wrong entry with 'emaphm history "
            "withdraw'"
        )
    if row.hours != entry.hours:
        raise HistoryError(
            f"this recording is in the history already, as '{row.name}' at {row.hours:.9g} h; it cannot be "
            f"of {entry.hours:.9g} h too, check --hours; withdraw a wrong entry with 'emaphm history "
            "withdraw'"
        )
    if None not in (row.cycles, entry.cycles) and row.cycles != entry.cycles:
        raise HistoryError(
            f"this recording is in the history already, as '{row.name}' at {row.cycles} cycles; it cannot be "
            f"of {entry.cycles} cycles too, check --cycles"
        )
    return True


def _check_hours(connection: sa.Connection, unit: UnitRow, entry: Entry) -> None:
    """Refuse hours below the unit's latest entry, unless the entry is `late`."""
    latest, kind = latest_entry(connection, unit.id)
    if entry.hours < latest and not entry.late:
        raise HistoryError(
            f"unit '{entry.unit}' has {latest:.9g} h already, from a {kind} (withdraw a wrong entry with "
            f"'emaphm history withdraw'), {entry.hours:.9g} h would be going backwards; check --hours, or "
            "give --late for an old recording that is added late"
        )


def _check_cycles(connection: sa.Connection, unit: UnitRow, entry: Entry) -> None:
    """Refuse cycles that fall while hours rise, or two numbers of cycles at the same hours."""
    if entry.cycles is None:
        return
    of_unit = sa.select(FLIGHTS.c.hours, FLIGHTS.c.cycles).where(
        FLIGHTS.c.unit_id == unit.id, FLIGHTS.c.cycles.is_not(None)
    )
    wrong = sa.or_(
        sa.and_(FLIGHTS.c.hours < entry.hours, FLIGHTS.c.cycles > entry.cycles),
        sa.and_(FLIGHTS.c.hours > entry.hours, FLIGHTS.c.cycles < entry.cycles),
        sa.and_(FLIGHTS.c.hours == entry.hours, FLIGHTS.c.cycles != entry.cycles),
    )
    row = connection.execute(of_unit.where(wrong).limit(1)).first()
    if row is not None:
        raise HistoryError(
            f"unit '{entry.unit}' had {row.cycles} cycles at {row.hours:.9g} h, so {entry.cycles} at "
            f"{entry.hours:.9g} h cannot be; check --cycles and --hours; {WRONG_FLIGHT}"
        )


def _check_stress(connection: sa.Connection, unit: UnitRow, entry: Entry) -> None:
    """Refuse a load or temperature that differs from that of another recording of the flight."""
    row = connection.execute(
        sa.select(FLIGHTS.c.load, FLIGHTS.c.temperature).where(
            FLIGHTS.c.unit_id == unit.id, FLIGHTS.c.hours == entry.hours
        )
    ).one_or_none()
    if row is None:
        return
    for name, known, given in (
        ("load", row.load, entry.load),
        ("temperature", row.temperature, entry.temperature),
    ):
        if None not in (known, given) and known != given:
            raise HistoryError(
                f"unit '{entry.unit}' has the {name} {known:.9g} at {entry.hours:.9g} h already, not "
                f"{given:.9g}; check --{name} and --hours; {WRONG_FLIGHT}"
            )


def add_diagnosis(
    connection: sa.Connection,
    entry: Entry,
    recording: "Recording",
    diagnosis: "Diagnosis",
    recording_hash: str,
    settings: "KeptSettings",
    toml: str,
) -> bool:
    """Add a diagnosis with its unit, flight and recording; return False if it already exists."""
    check_entry(connection, entry, recording_hash)
    if has_diagnosis(connection, recording_hash, settings):
        return False
    now = timestamp()
    unit_id = _id_of(
        connection,
        UNITS,
        {"serial_number": entry.unit},
        {"part_number": entry.part_number, "added_at": now},
    )
    stated = {
        "cycles": entry.cycles,
        "position": entry.position,
        "load": entry.load,
        "temperature": entry.temperature,
    }
    flight_id = _id_of(
        connection,
        FLIGHTS,
        {"unit_id": unit_id, "hours": entry.hours},
        stated,
    )
    # Values that an earlier recording of the flight did not give.
    given = {name: value for name, value in stated.items() if value is not None}
    if given:
        connection.execute(FLIGHTS.update().where(FLIGHTS.c.id == flight_id).values(given))
    recording_id = _id_of(
        connection,
        RECORDINGS,
        {"hash": recording_hash},
        {
            "flight_id": flight_id,
            "name": storable(recording.source),
            "samples": recording.samples,
            "sample_rate_hz": recording.sample_rate_hz,
            "added_at": now,
        },
    )
    description_id = _id_of(connection, DESCRIPTIONS, {"hash": settings.description}, {"toml": toml})
    row = {"recording_id": recording_id, "description_id": description_id, "added_at": now}
    connection.execute(DIAGNOSES.insert().values(row | row_of(diagnosis)))
    return True


def add_removal(connection: sa.Connection, unit: UnitRow, removal: Removal) -> bool:
    """Add a removal; return False if it already exists, and refuse another removal at the same hours."""
    key = {"unit_id": unit.id, "hours": removal.hours}
    values = {"reason": removal.reason, "note": removal.note}
    return _added(
        connection, REMOVALS, key, values, f"unit '{unit.serial_number}' at {removal.hours:.9g} h: a removal"
    )


def add_finding(connection: sa.Connection, unit: UnitRow, finding: Finding) -> bool:
    """Add a shop's finding; return False if it already exists, and refuse one with the same key."""
    key = {"unit_id": unit.id, "hours": finding.hours, "component": finding.component}
    values = {
        "condition": finding.condition,
        "level": finding.level,
        "replaced": finding.replaced,
        "note": finding.note,
    }
    title = f"unit '{unit.serial_number}' at {finding.hours:.9g} h: a finding on {finding.component}"
    return _added(connection, FINDINGS, key, values, title)


def storable(text: str) -> str:
    """Return text that every database can store: a file name may be invalid Unicode."""
    return text.encode("utf-8", "backslashreplace").decode().replace("\0", "")


def _added(
    connection: sa.Connection, table: sa.Table, key: dict[str, Any], values: dict[str, Any], title: str
) -> bool:
    """Add a row with a unique `key`; return False if it exists, and refuse other values."""
    row = connection.execute(sa.select(table).where(*_equal(table, key))).one_or_none()
    if row is None:
        connection.execute(table.insert().values(key | values | {"added_at": timestamp()}))
        return True
    stored = {name: getattr(row, name) for name in values}
    if stored != values:
        differing = ", ".join(f"{name} {value!r}" for name, value in stored.items() if values[name] != value)
        raise HistoryError(
            f"{title} is in the history already, with {differing}; nothing was changed; withdraw a wrong "
            "entry with 'emaphm history withdraw'"
        )
    return False


def _id_of(connection: sa.Connection, table: sa.Table, key: dict[str, Any], values: dict[str, Any]) -> int:
    """Return the id of the row with the unique `key`; a missing row is added with `values`."""
    row_id = connection.execute(sa.select(table.c.id).where(*_equal(table, key))).scalar()
    if row_id is None:
        added = table.insert().values(key | values).returning(table.c.id)
        row_id = connection.execute(added).scalar_one()
    return int(row_id)


def _equal(table: sa.Table, key: dict[str, Any]) -> list[sa.ColumnElement[bool]]:
    """Return the conditions that a row has the `key`."""
    return [table.c[name] == value for name, value in key.items()]
