"""Format of times in a history."""

from datetime import UTC, datetime


def timestamp() -> str:
    """Return the time now, UTC, ISO 8601, to the second."""
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
