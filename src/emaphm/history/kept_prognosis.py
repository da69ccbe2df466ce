"""Stored last prognosis of a unit, so that a reader need not compute it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import sqlalchemy as sa

from emaphm.history.basis import Basis
from emaphm.history.reading import UnitRow
from emaphm.history.storage.tables import PROGNOSES, PROGNOSIS_CURVES, UNITS
from emaphm.strict_json import finite

ENTRIES = "made_from_entries"
"""Key of `Basis.entries` in the stored document; a prognosis has no key of this name."""


@dataclass(frozen=True)
class KeptPrognosis:
    """Output of `emaphm prognose --json` for a unit at flight `hours` [h], and its `basis`."""

    hours: float
    document: Mapping[str, Any] = field(repr=False)
    basis: Basis

    @classmethod
    def of(cls, basis: Basis, document: Mapping[str, Any]) -> "KeptPrognosis":
        """Return the prognosis `document` (`emaphm prognose --json`) that was made from `basis`."""
        return cls(float(document["hours"]), document, basis)

    @property
    def diagnoses(self) -> int:
        """Number of diagnoses that the unit had had, including superseded ones."""
        return self.basis.diagnoses

    @property
    def at(self) -> str:
        """Time at which it was started, UTC, ISO 8601."""
        return self.basis.at

    def is_current(self, now: Basis) -> bool:
        """Return whether the unit has the same entries as when the prognosis was started.

        `now` is the basis of a prognosis that starts now.
        """
        return self.basis == now


def keep_prognosis(
    connection: sa.Connection,
    unit: UnitRow,
    prognosis: KeptPrognosis,
    curves: Mapping[str, Any] | None = None,
) -> None:
    """Store a prognosis and its `curves`, ready for JSON, replacing the previous ones.

    Without `curves`, the stored curves are deleted, because they would be shown with the new prognosis.
    """
    values = {
        "hours": prognosis.hours,
        "diagnoses": prognosis.diagnoses,
        "document": json.dumps(finite({**prognosis.document, ENTRIES: prognosis.basis.entries})),
        "at": prognosis.at,
    }
    changed = connection.execute(PROGNOSES.update().where(PROGNOSES.c.unit_id == unit.id).values(values))
    if not changed.rowcount:
        connection.execute(PROGNOSES.insert().values(values | {"unit_id": unit.id}))
    connection.execute(PROGNOSIS_CURVES.delete().where(PROGNOSIS_CURVES.c.unit_id == unit.id))
    if curves is not None:
        of_unit = {"unit_id": unit.id, "hours": prognosis.hours, "diagnoses": prognosis.diagnoses}
        text = json.dumps(finite(dict(curves)))
        connection.execute(PROGNOSIS_CURVES.insert().values(of_unit | {"document": text}))


def read_prognosis(connection: sa.Connection, unit_id: int) -> KeptPrognosis | None:
    """Return the stored prognosis of a unit, None without any."""
    query = sa.select(PROGNOSES).where(PROGNOSES.c.unit_id == unit_id)
    row = connection.execute(query).one_or_none()
    return None if row is None else _kept(row)


def read_prognoses(connection: sa.Connection) -> dict[str, KeptPrognosis]:
    """Return the stored prognoses by serial number."""
    query = sa.select(UNITS.c.serial_number, PROGNOSES).join(UNITS, UNITS.c.id == PROGNOSES.c.unit_id)
    return {row.serial_number: _kept(row) for row in connection.execute(query)}


def _kept(row: sa.Row[Any]) -> KeptPrognosis:
    document = json.loads(row.document)
    entries = document.pop(ENTRIES, None)
    return KeptPrognosis(
        row.hours, document, Basis(row.diagnoses, None if entries is None else tuple(entries), row.at)
    )
