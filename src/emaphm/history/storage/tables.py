"""Tables of a history, after the newest migration.

A recording belongs to a flight, and a flight to a unit: the hours are stored once. Arrays are little-endian
double precision, row by row; documents are JSON.
"""

import sqlalchemy as sa

METADATA = sa.MetaData()


def _of(table: str) -> sa.ForeignKey:
    return sa.ForeignKey(f"{table}.id")


UNITS = sa.Table(
    "units",
    METADATA,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("serial_number", sa.Text, nullable=False, unique=True),
    sa.Column("part_number", sa.Text, nullable=False),
    sa.Column("added_at", sa.Text, nullable=False),
)

FLIGHTS = sa.Table(
    "flights",
    METADATA,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("unit_id", sa.Integer, _of("units"), nullable=False),
    sa.Column("hours", sa.Double, nullable=False),
    sa.Column("cycles", sa.Integer),
    sa.Column("position", sa.Text),
    sa.Column("load", sa.Double),
    sa.Column("temperature", sa.Double),
    sa.UniqueConstraint("unit_id", "hours"),
)

DESCRIPTIONS = sa.Table(
    "descriptions",
    METADATA,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("hash", sa.Text, nullable=False, unique=True),
    sa.Column("toml", sa.Text, nullable=False),
)

RECORDINGS = sa.Table(
    "recordings",
    METADATA,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("flight_id", sa.Integer, _of("flights"), nullable=False, index=True),
    sa.Column("hash", sa.Text, nullable=False, unique=True),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("samples", sa.Integer, nullable=False),
    sa.Column("sample_rate_hz", sa.Double, nullable=False),
    sa.Column("added_at", sa.Text, nullable=False),
)

DIAGNOSES = sa.Table(
    "diagnoses",
    METADATA,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("recording_id", sa.Integer, _of("recordings"), nullable=False),
    sa.Column("description_id", sa.Integer, _of("descriptions"), nullable=False),
    sa.Column("method", sa.Text, nullable=False),
    sa.Column("model", sa.Text, nullable=False),
    sa.Column("fitness", sa.Text, nullable=False),
    sa.Column("seed", sa.Text, nullable=False),
    sa.Column("version", sa.Text, nullable=False),
    sa.Column("explained", sa.Boolean, nullable=False),
    sa.Column("vector", sa.LargeBinary, nullable=False),
    sa.Column("standard_errors", sa.LargeBinary, nullable=False),
    sa.Column("coordinates", sa.Text, nullable=False),
    sa.Column("covariance", sa.LargeBinary, nullable=False),
    sa.Column("document", sa.Text, nullable=False),
    sa.Column("added_at", sa.Text, nullable=False),
    sa.UniqueConstraint("recording_id", "description_id", "method", "model", "fitness", "seed"),
    sa.Index("diagnoses_of_recordings", "recording_id", "id", "explained"),
)

REMOVALS = sa.Table(
    "removals",
    METADATA,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("unit_id", sa.Integer, _of("units"), nullable=False),
    sa.Column("hours", sa.Double, nullable=False),
    sa.Column("reason", sa.Text, nullable=False),
    sa.Column("note", sa.Text, nullable=False),
    sa.Column("added_at", sa.Text, nullable=False),
    sa.UniqueConstraint("unit_id", "hours"),
)

FINDINGS = sa.Table(
    "findings",
    METADATA,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("unit_id", sa.Integer, _of("units"), nullable=False),
    sa.Column("hours", sa.Double, nullable=False),
    sa.Column("component", sa.Text, nullable=False),
    sa.Column("condition", sa.Text, nullable=False),
    sa.Column("level", sa.Double),
    sa.Column("replaced", sa.Boolean, nullable=False),
    sa.Column("note", sa.Text, nullable=False),
    sa.Column("added_at", sa.Text, nullable=False),
    sa.UniqueConstraint("unit_id", "hours", "component"),
)

WITHDRAWALS = sa.Table(
    "withdrawals",
    METADATA,
    sa.Column("id", sa.Integer, primary_key=True),
    # Not the unit's id: a unit is deleted with its last recording.
    sa.Column("serial_number", sa.Text, nullable=False, index=True),
    sa.Column("kind", sa.Text, nullable=False),
    sa.Column("hours", sa.Double, nullable=False),
    sa.Column("subject", sa.Text, nullable=False),
    sa.Column("reason", sa.Text, nullable=False),
    sa.Column("document", sa.Text, nullable=False),
    sa.Column("at", sa.Text, nullable=False),
)

EVENTS = sa.Table(
    "events",
    METADATA,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("key", sa.Text, nullable=False, unique=True),
    sa.Column("watcher", sa.Text, nullable=False, index=True),
    sa.Column("at", sa.Text, nullable=False),
    sa.Column("kind", sa.Text, nullable=False, index=True),
    sa.Column("state", sa.Text, nullable=False),
    sa.Column("severity", sa.Text, nullable=False),
    sa.Column("unit", sa.Text, index=True),
    sa.Column("hours", sa.Double),
    sa.Column("subject", sa.Text, nullable=False),
    sa.Column("message", sa.Text, nullable=False),
    sa.Column("recording", sa.Text),
    sa.Column("recording_hash", sa.Text),
    sa.Column("details", sa.Text, nullable=False),
)

PROGNOSES = sa.Table(
    "prognoses",
    METADATA,
    sa.Column("unit_id", sa.Integer, _of("units"), primary_key=True),
    sa.Column("hours", sa.Double, nullable=False),
    sa.Column("diagnoses", sa.Integer, nullable=False),
    sa.Column("document", sa.Text, nullable=False),
    sa.Column("at", sa.Text, nullable=False),
)

PROGNOSIS_CURVES = sa.Table(
    "prognosis_curves",
    METADATA,
    sa.Column("unit_id", sa.Integer, _of("units"), primary_key=True),
    sa.Column("hours", sa.Double, nullable=False),
    sa.Column("diagnoses", sa.Integer, nullable=False),
    sa.Column("document", sa.Text, nullable=False),
)

WATCHED_FILES = sa.Table(
    "watched_files",
    METADATA,
    sa.Column("watcher", sa.Text, primary_key=True),
    sa.Column("name", sa.Text, primary_key=True),
    sa.Column("size", sa.BigInteger, nullable=False),
    sa.Column("modified_ns", sa.BigInteger, nullable=False),
    sa.Column("digest", sa.Text, nullable=False),
    sa.Column("outcome", sa.Text, nullable=False),
)

WATCHED_ROWS = sa.Table(
    "watched_rows",
    METADATA,
    sa.Column("watcher", sa.Text, primary_key=True),
    sa.Column("unit", sa.Text, primary_key=True),
    sa.Column("hours", sa.Double, nullable=False),
    sa.Column("time_s", sa.Double, nullable=False),
)

DELIVERED = sa.Table(
    "delivered",
    METADATA,
    sa.Column("watcher", sa.Text, primary_key=True),
    sa.Column("receiver", sa.Text, primary_key=True),
    sa.Column("event_id", sa.Integer, nullable=False),
)
