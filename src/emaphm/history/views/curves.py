"""The curves of a unit's last prognosis, kept so that figures need not compute it again."""

import json
from typing import Any

import sqlalchemy as sa

from emaphm.history.storage.tables import PROGNOSIS_CURVES
from emaphm.strict_json import finite


def keep_curves(
    connection: sa.Connection, unit_id: int, hours: float, diagnoses: int, document: dict[str, Any]
) -> None:
    """Keep the curves of a unit's prognosis, made at flight `hours` [h] from a number of `diagnoses`.

    They replace those kept before. `connection` writes; `document` is ready for JSON.
    """
    values = {"hours": hours, "diagnoses": diagnoses, "document": json.dumps(finite(document))}
    of_unit = PROGNOSIS_CURVES.c.unit_id == unit_id
    if not connection.execute(PROGNOSIS_CURVES.update().where(of_unit).values(values)).rowcount:
        connection.execute(PROGNOSIS_CURVES.insert().values(values | {"unit_id": unit_id}))


def read_curves(connection: sa.Connection, unit_id: int) -> dict[str, Any] | None:
    """Return the `document` that `keep_curves` kept of the unit with that id, None where there is none."""
    query = sa.select(PROGNOSIS_CURVES.c.document).where(PROGNOSIS_CURVES.c.unit_id == unit_id)
    document = connection.execute(query).scalar()
    return None if document is None else dict(json.loads(document))
