"""What a prognosis of a unit is made from, to be compared with what the history has of the unit later."""

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
    """What the history had of a unit when it was read; equal as long as nothing was added or withdrawn.

    Numbers and not a time: a second is long enough for a finding to come after what was read in it. Nothing
    is ever changed in its place, and what is withdrawn leaves a withdrawal, so that equal numbers are equal
    entries.

    Attributes
    ----------
    diagnoses
        How many the unit has had, those among them that others have replaced.
    entries
        How many removals, findings and withdrawals; None where an older version has kept the prognosis, which
        did not count them: it equals that of no unit.
    at
        When it was read, UTC, ISO 8601; not compared.
    """

    diagnoses: int
    entries: tuple[int, int, int] | None
    at: str = field(default_factory=timestamp, compare=False)


def bases(connection: sa.Connection, chosen: sa.ColumnElement[bool]) -> dict[int, Basis]:
    """Return by unit what the history has of it now, of the `chosen` ones; `connection` reads it."""
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
