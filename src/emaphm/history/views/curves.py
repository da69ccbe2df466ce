"""Stored curves of a unit's last prognosis, for figures without a new computation."""

import json
from typing import Any

import sqlalchemy as sa

from emaphm.history.storage.tables import PROGNOSIS_CURVES


def read_curves(connection: sa.Connection, unit_id: int) -> dict[str, Any] | None:
    """Return the curves that `keep_prognosis` stored for the unit with this id, None without any."""
    query = sa.select(PROGNOSIS_CURVES.c.document).where(PROGNOSIS_CURVES.c.unit_id == unit_id)
    document = connection.execute(query).scalar()
    return None if document is None else dict(json.loads(document))
