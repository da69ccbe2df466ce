"""Bringing a database to the form that this version knows, in place, when it is opened.

All steps and the mark of the newest are one transaction: an interrupted one leaves the form that was there.
"""

import sqlite3
import time
from pathlib import Path

import sqlalchemy as sa

from emaphm.errors import HistoryError, HistoryFormError
from emaphm.history.storage.database import SETTINGS, Database
from emaphm.history.storage.tables import METADATA

NEWEST = "0007"
"""The last of `KNOWN`, which this version reads and writes."""

KNOWN = ("0001", "0002", "0003", "0004", "0005", "0006", "0007")
"""The steps in `migrations/versions`, in order."""

VERSION = sa.Table("history_version", sa.MetaData(), sa.Column("version_num", sa.Text))

ADVISORY_LOCK = "SELECT pg_advisory_xact_lock(hashtext('emaphm history'))"
"""Lets one process at a time make or change the tables, where there is no table yet that could be locked."""

PAUSE_S = 0.01
"""Between attempts to switch a new file to write-ahead logging, which SQLite does not wait for by itself."""


def bring_up_to_date(database: Database, *, create: bool) -> None:
    """Make the tables of a new history where `create` allows, or take those of an older one to `NEWEST`.

    Raises
    ------
    HistoryError
        The database is no history, or a newer version of emaphm has changed it.
    """
    if _revision(database, create=create) == NEWEST:
        return
    if database.is_file:
        _log_ahead(database)
    with database.writing(ADVISORY_LOCK) as connection:
        upgrade(connection, NEWEST)


def check_revision(connection: sa.Connection, shown: str) -> None:
    """Refuse to write what has been given another form since it was opened, `HistoryError`."""
    found = connection.execute(sa.select(VERSION.c.version_num)).scalar_one()
    if found != NEWEST:
        raise _newer(shown, found)


def upgrade(connection: sa.Connection, revision: str) -> None:
    """Take the steps up to `revision`, in the transaction of `connection`; none where it is there already."""
    from alembic import command
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations").replace("%", "%%"))
    config.attributes["connection"] = connection
    command.upgrade(config, revision)


def _revision(database: Database, *, create: bool) -> str | None:
    """Return the last step that the database has seen, None where it is empty."""
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
        # Besides a history a server may hold what it likes; a file with other tables is somebody else's.
        others = tables - {VERSION.name} if database.is_file else tables & set(METADATA.tables)
        if others:
            new = "a new name" if database.is_file else "a database or a schema (search_path) of its own"
            raise HistoryError(
                f"{shown}: is no history, it has a table '{min(others)}'; give a history, or {new}"
            )
        if not create:
            raise HistoryError(f"{shown}: holds no history; {database.address.remedy}")
        return None
    if marks[0] not in KNOWN:
        raise _newer(shown, marks[0])
    return str(marks[0])


def _newer(shown: str, found: str) -> HistoryFormError:
    return HistoryFormError(
        f"{shown}: a newer version of emaphm wrote this history (form {found}; this version knows up to "
        f"{NEWEST}); update emaphm, or give another history"
    )


def _log_ahead(database: Database) -> None:
    """Switch a SQLite file to write-ahead logging, for good: readers then do not wait for a writer."""
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
