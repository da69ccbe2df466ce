"""Table of the curves of a unit's last prognosis, for pages."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    """Create the table."""
    op.create_table(
        "prognosis_curves",
        sa.Column("unit_id", sa.Integer, sa.ForeignKey("units.id"), primary_key=True),
        sa.Column("hours", sa.Double, nullable=False),
        sa.Column("diagnoses", sa.Integer, nullable=False),
        sa.Column("document", sa.Text, nullable=False),
    )
