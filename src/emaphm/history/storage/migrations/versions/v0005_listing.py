"""Index for listing units without reading full diagnoses, of some kilobytes each."""

from alembic import op

revision = "0005"
down_revision = "0004"


def upgrade() -> None:
    """Add the index."""
    op.create_index("diagnoses_of_recordings", "diagnoses", ["recording_id", "id", "explained"])
