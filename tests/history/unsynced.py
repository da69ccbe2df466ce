"""Histories that do not wait for the disk: half of the time of a test that adds to one.

What is acknowledged then outlasts a killed process, but no loss of power, which no test makes.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager

import sqlalchemy as sa


@contextmanager
def unsynced() -> Iterator[None]:
    """Let each new connection of this process to a file leave it to the system when to write."""

    def leave(connection: object, _: object) -> None:
        if isinstance(connection, sqlite3.Connection):
            connection.execute("PRAGMA synchronous = OFF")

    sa.event.listen(sa.Pool, "connect", leave)
    try:
        yield
    finally:
        sa.event.remove(sa.Pool, "connect", leave)
