"""The last prognosis of a unit, kept so that a reader need not compute it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import sqlalchemy as sa

from emaphm.history.reading import UnitRow
from emaphm.history.storage.tables import PROGNOSES, UNITS
from emaphm.history.timestamp import timestamp
from emaphm.strict_json import finite


@dataclass(frozen=True)
class Basis:
    """What a prognosis is made from: the number of `diagnoses` that the unit had had, and when that was."""

    diagnoses: int
    at: str


@dataclass(frozen=True)
class KeptPrognosis:
    """What `emaphm prognose --json` prints of a unit, at its flight `hours` [h].

    `diagnoses` and `at` are those of its `Basis`.
    """

    hours: float
    diagnoses: int
    document: Mapping[str, Any] = field(repr=False)
    at: str = field(default_factory=timestamp)

    @classmethod
    def of(cls, basis: Basis, document: Mapping[str, Any]) -> "KeptPrognosis":
        """Return a prognosis, as `emaphm prognose --json` prints it, that was made from `basis`."""
        return cls(float(document["hours"]), basis.diagnoses, document, basis.at)

    def is_current(self, diagnoses: int, changed: str) -> bool:
        """Return whether the unit is as it was when the prognosis was begun; else it is out of date.

        Parameters
        ----------
        diagnoses
            How many the unit has had, those that replace others among them.
        changed
            When its newest removal, finding or withdrawal was made, UTC, ISO 8601; empty where it has none.
        """
        return self.diagnoses == diagnoses and self.at >= changed


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
