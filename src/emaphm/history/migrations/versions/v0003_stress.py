"""What flights stressed a unit with: load and temperature."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Add the columns; older flights have none of it."""
    op.add_column("flights", sa.Column("load", sa.Double))
    op.add_column("flights", sa.Column("temperature", sa.Double))
