"""What flights stressed a unit with: load and temperature."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """Add the columns; older flights have none of it."""
    op.add_column("flights", sa.Column("load", sa.Double))
    op.add_column("flights", sa.Column("temperature", sa.Double))
