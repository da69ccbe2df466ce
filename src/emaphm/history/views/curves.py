"""The curves of a unit's last prognosis, kept so that figures need not compute it again."""

import json
from typing import Any

import sqlalchemy as sa

from emaphm.history.storage.tables import PROGNOSIS_CURVES


def read_curves(connection: sa.Connection, unit_id: int) -> dict[str, Any] | None:
    """Return the curves that `keep_prognosis` kept of the unit with that id, None where there are none."""
    query = sa.select(PROGNOSIS_CURVES.c.document).where(PROGNOSIS_CURVES.c.unit_id == unit_id)
    document = connection.execute(query).scalar()
    return None if document is None else dict(json.loads(document))
