"""Upgrade of a database to the schema of this version, in place, when it is opened.

All migrations and the version mark are one transaction: an interrupted upgrade leaves the old schema.
"""

import sqlite3
import time
from pathlib import Path

import sqlalchemy as sa

from emaphm.errors import HistoryError, HistoryFormError
from emaphm.history.storage.database import SETTINGS, Database
from emaphm.history.storage.tables import METADATA

NEWEST = "0007"
"""The last schema of `KNOWN`, which this version reads and writes."""

KNOWN = ("0001", "0002", "0003", "0004", "0005", "0006", "0007")
"""The migrations in `migrations/versions`, in order."""

VERSION = sa.Table("history_version", sa.MetaData(), sa.Column("version_num", sa.Text))

ADVISORY_LOCK = "SELECT pg_advisory_xact_lock(hashtext('emaphm history'))"
"""Lock for creating or changing tables by one process at a time, as there may be no table to lock yet."""

PAUSE_S = 0.01
"""Pause between attempts to set a new file to write-ahead logging, for which SQLite does not wait [s]."""


def bring_up_to_date(database: Database, *, create: bool) -> None:
    """Create the tables of a new history if `create` allows, or upgrade those of an older one to `NEWEST`.

    Raises
    ------
    HistoryError
        The database is not a history, or a newer version of emaphm has changed it.
    """
    if _revision(database, create=create) == NEWEST:
        return
    if database.is_file:
        _log_ahead(database)
    with database.writing(ADVISORY_LOCK) as connection:
        upgrade(connection, NEWEST)


def check_revision(connection: sa.Connection, shown: str) -> None:
    """Refuse to write if the schema has been changed since the history was opened, `HistoryError`."""
    revision = connection.execute(sa.select(VERSION.c.version_num)).scalar_one()
    if revision != NEWEST:
        raise _newer(shown, revision)


def upgrade(connection: sa.Connection, revision: str) -> None:
    """Apply the migrations up to `revision`, in the transaction of `connection`, if any are missing."""
    from alembic import command
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations").replace("%", "%%"))
    config.attributes["connection"] = connection
    command.upgrade(config, revision)


def _revision(database: Database, *, create: bool) -> str | None:
    """Return the last applied migration of the database, None for an empty database."""
    shown = database.address.shown
    with database.reading() as connection:
        inspected = sa.inspect(connection)
        tables = {*inspected.get_table_names(), *inspected.get_view_names()}
        marks = (
            connection.execute(sa.select(VERSION.c.version_num)).scalars().all()
            if VERSION.name in tables
            else []
        )
    if not marks:
        # A server may contain other tables; a file with other tables belongs to another program.
        foreign_tables = tables - {VERSION.name} if database.is_file else tables & set(METADATA.tables)
        if foreign_tables:
            alternative = (
                "a new name" if database.is_file else "a database or a schema (search_path) of its own"
            )
            raise HistoryError(
                f"{shown}: is no history, it has a table '{min(foreign_tables)}'; give a history, or "
                f"{alternative}"
            )
        if not create:
            raise HistoryError(f"{shown}: holds no history; {database.address.remedy}")
        return None
    if marks[0] not in KNOWN:
        raise _newer(shown, marks[0])
    return str(marks[0])


def _newer(shown: str, revision: str) -> HistoryFormError:
    return HistoryFormError(
        f"{shown}: a newer version of emaphm wrote this history (form {revision}; this version knows up to "
        f"{NEWEST}); update emaphm, or give another history"
    )


def _log_ahead(database: Database) -> None:
    """Set a SQLite file permanently to write-ahead logging, so that readers do not wait for a writer."""
    deadline = time.monotonic() + SETTINGS.answer_s
    connection = database.engine.raw_connection()
    try:
        while True:
            try:
                connection.cursor().execute("PRAGMA journal_mode = WAL")
            except sqlite3.OperationalError as error:
                if "locked" not in str(error) or time.monotonic() > deadline:
                    raise HistoryError(
                        f"{database.address.shown}: cannot be written ({error}); give another place, on a "
                        "disk of this machine"
                    ) from None
                time.sleep(PAUSE_S)
            else:
                return
    finally:
        connection.close()
