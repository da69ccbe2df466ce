"""What pages read: an index over whether recordings are explained, and the curves of the last prognosis."""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"


def upgrade() -> None:
    """Make the index and the table."""
    op.create_index("diagnoses_explained", "diagnoses", ["recording_id", "id", "explained"])
    op.create_table(
        "prognosis_curves",
        sa.Column("unit_id", sa.Integer, sa.ForeignKey("units.id"), primary_key=True),
        sa.Column("hours", sa.Double, nullable=False),
        sa.Column("diagnoses", sa.Integer, nullable=False),
        sa.Column("document", sa.Text, nullable=False),
    )
