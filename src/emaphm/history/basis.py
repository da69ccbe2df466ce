"""Basis of a prognosis: numbers of entries of the unit, for the comparison with its later entries."""

from dataclasses import dataclass, field
from typing import Any

import sqlalchemy as sa

from emaphm.history.storage.tables import (
    DIAGNOSES,
    FINDINGS,
    FLIGHTS,
    RECORDINGS,
    REMOVALS,
    UNITS,
    WITHDRAWALS,
)
from emaphm.history.timestamp import timestamp


@dataclass(frozen=True)
class Basis:
    """Numbers of entries of a unit when it was read; equal as long as nothing was added or withdrawn.

    Numbers are used instead of a time, because a finding may be added in the same second after the reading.
    Entries are never changed in place, and a withdrawn entry adds a withdrawal, so that equal numbers mean
    equal entries.

    Attributes
    ----------
    diagnoses
        Number of diagnoses that the unit has had, including superseded ones.
    entries
        Numbers of removals, findings and withdrawals; None in a prognosis of an older version, which did not
        count them: it is then not equal to any basis.
    at
        Time of reading, UTC, ISO 8601; not compared.
    """

    diagnoses: int
    entries: tuple[int, int, int] | None
    at: str = field(default_factory=timestamp, compare=False)


def bases(connection: sa.Connection, chosen: sa.ColumnElement[bool]) -> dict[int, Basis]:
    """Return the present basis, by unit, of the units that meet the condition `chosen`."""
    now = timestamp()
    diagnoses = (
        sa.select(FLIGHTS.c.unit_id, sa.func.count())
        .select_from(FLIGHTS)
        .join(UNITS, UNITS.c.id == FLIGHTS.c.unit_id)
        .join(RECORDINGS, RECORDINGS.c.flight_id == FLIGHTS.c.id)
        .join(DIAGNOSES, DIAGNOSES.c.recording_id == RECORDINGS.c.id)
        .where(chosen)
        .group_by(FLIGHTS.c.unit_id)
    )
    of_unit = (
        (REMOVALS, REMOVALS.c.unit_id == UNITS.c.id),
        (FINDINGS, FINDINGS.c.unit_id == UNITS.c.id),
        (WITHDRAWALS, WITHDRAWALS.c.serial_number == UNITS.c.serial_number),
    )
    removals, findings, withdrawals = (
        _counted(
            connection,
            sa.select(UNITS.c.id, sa.func.count())
            .select_from(UNITS)
            .join(table, joined)
            .where(chosen)
            .group_by(UNITS.c.id),
        )
        for table, joined in of_unit
    )
    return {
        unit: Basis(count, (removals.get(unit, 0), findings.get(unit, 0), withdrawals.get(unit, 0)), now)
        for unit, count in _counted(connection, diagnoses).items()
    }


def _counted(connection: sa.Connection, query: sa.Select[Any]) -> dict[int, int]:
    return {row[0]: row[1] for row in connection.execute(query)}
