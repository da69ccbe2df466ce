"""Stress of flights: load and temperature."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """Add the columns; they are empty for older flights."""
    op.add_column("flights", sa.Column("load", sa.Double))
    op.add_column("flights", sa.Column("temperature", sa.Double))
