"""The last prognosis of a unit, kept so that a reader need not compute it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa

from emaphm.history.reading import UnitRow
from emaphm.history.tables import PROGNOSES, UNITS
from emaphm.strict_json import finite


@dataclass(frozen=True)
class KeptPrognosis:
    """What `emaphm prognose --json` prints of a unit, at its flight `hours` [h].

    `diagnoses` is how many the unit had then: with more, the prognosis is out of date. `at` is when it was
    made, UTC, ISO 8601.
    """

    hours: float
    diagnoses: int
    document: Mapping[str, Any] = field(repr=False)
    at: str = field(default_factory=lambda: datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"))


def keep_prognosis(connection: sa.Connection, unit: UnitRow, prognosis: KeptPrognosis) -> None:
    """Keep a prognosis in place of the one before."""
    values = {
        "hours": prognosis.hours,
        "diagnoses": prognosis.diagnoses,
        "document": json.dumps(finite(dict(prognosis.document))),
        "at": prognosis.at,
    }
    changed = connection.execute(PROGNOSES.update().where(PROGNOSES.c.unit_id == unit.id).values(values))
    if not changed.rowcount:
        connection.execute(PROGNOSES.insert().values(values | {"unit_id": unit.id}))


def read_prognosis(connection: sa.Connection, unit_id: int) -> KeptPrognosis | None:
    """Return the kept prognosis of a unit, None where it has none."""
    query = sa.select(PROGNOSES).where(PROGNOSES.c.unit_id == unit_id)
    row = connection.execute(query).one_or_none()
    return None if row is None else KeptPrognosis(row.hours, row.diagnoses, json.loads(row.document), row.at)


def read_prognoses(connection: sa.Connection) -> dict[str, KeptPrognosis]:
    """Return the kept prognoses by serial number."""
    query = sa.select(UNITS.c.serial_number, PROGNOSES).join(UNITS, UNITS.c.id == PROGNOSES.c.unit_id)
    return {
        row.serial_number: KeptPrognosis(row.hours, row.diagnoses, json.loads(row.document), row.at)
        for row in connection.execute(query)
    }
