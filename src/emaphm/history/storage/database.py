"""Connections and transactions: SQLite in write-ahead mode and PostgreSQL, with the same guarantees.

One transaction writes at a time: on SQLite it begins with the write lock (BEGIN IMMEDIATE), on PostgreSQL it
locks the table of units. A check and the rows it protects are therefore atomic with several writers. Readers
read one consistent state of the history, and do not wait.
"""

import sqlite3
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, Self

import sqlalchemy as sa
from sqlalchemy.exc import DataError, DBAPIError, IntegrityError, SQLAlchemyError
from sqlalchemy.pool import QueuePool

from emaphm.errors import HistoryError, HistoryUnavailableError
from emaphm.history.storage.address import Address


@dataclass(frozen=True)
class DatabaseSettings:
    """Timeouts [s] for other programs, servers and networks.

    `answer_s`: for the first connection, below the ten seconds in which a user must learn of a failure.
    `file_s`: for a file that another program has locked when it is opened, within `answer_s`.
    `host_s`: for each address of a host name, which often has two. `writer_s`: for other writers; eight
    simultaneous writers, of twelve recordings each, need about 5 s (`python -m tests.history.faults`).
    `silence_s`: for a server that stops answering during a connection.
    """

    answer_s: float = 8.0
    file_s: float = 6.0
    host_s: int = 4
    writer_s: int = 60
    silence_s: int = 20


SETTINGS = DatabaseSettings()

LONGEST_REASON = 300
"""Largest number of characters of a database's own message in an error."""


@dataclass(frozen=True)
class Database:
    """An open database; `close` releases its connections."""

    address: Address
    engine: sa.Engine

    @classmethod
    def open(cls, address: Address, *, create: bool) -> Self:
        """Return the database at `address`, after it has answered; `create` allows creating a missing file.

        Raises
        ------
        HistoryError
            There is no database, or it does not answer in time.
        """
        engine = _of_file(address, create=create) if address.file is not None else _of_server(address)
        database = cls(address, engine)
        try:
            _answer_in_time(database._answer, address)
        except BaseException:
            engine.dispose()
            raise
        return database

    @property
    def is_file(self) -> bool:
        """Whether the database is a SQLite file."""
        return self.address.file is not None

    def close(self) -> None:
        """Release the connections; SQLite then leaves one file."""
        self.engine.dispose()

    @contextmanager
    def reading(self) -> Iterator[sa.Connection]:
        """Yield a connection to one state of the history.

        Raises
        ------
        HistoryError
            The database fails; the error contains its message.
        """
        with self._errors(), self.engine.connect() as connection:
            if not self.is_file:
                connection.execution_options(isolation_level="REPEATABLE READ", postgresql_readonly=True)
            with connection.begin():
                yield connection

    @contextmanager
    def writing(self, lock: str = "LOCK TABLE units IN SHARE ROW EXCLUSIVE MODE") -> Iterator[sa.Connection]:
        """Yield a connection with the exclusive right to write; commit its transaction if the body ends.

        `lock` is the statement that excludes other writers on PostgreSQL.

        Raises
        ------
        HistoryError
            The database fails; the error contains its message.
        """
        with self._errors(), self.engine.connect() as connection:
            connection.execution_options(writing=True)
            with connection.begin():
                if not self.is_file:
                    connection.exec_driver_sql(f"SET LOCAL lock_timeout = '{SETTINGS.writer_s}s'")
                    connection.exec_driver_sql(lock)
                yield connection

    def _answer(self) -> None:
        with self.reading() as connection:
            # Not SELECT 1, which does not read SQLite's file.
            sa.inspect(connection).get_table_names()

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except (DataError, IntegrityError) as error:  # caused by the values: no later attempt would succeed
            raise HistoryError(
                f"{self.address.shown}: the database refuses a value ({_message(error.orig or error)}); "
                "correct it, or report it as a defect of emaphm"
            ) from None
        except DBAPIError as error:
            raise _complaint(self.address, error.orig or error) from None
        except SQLAlchemyError as error:
            raise _complaint(self.address, error) from None


def _of_file(address: Address, *, create: bool) -> sa.Engine:
    """Return the engine of a SQLite file."""
    path = address.file
    assert path is not None  # noqa: S101 - for the type checker
    try:
        exists = path.exists()
        if exists and not path.is_file():
            raise HistoryError(f"{path}: is no file; give the name of a file for the history")
        if not exists and not create:
            # It may be on a disk that is temporarily unavailable.
            raise HistoryUnavailableError(f"{path}: no such history; {address.remedy}")
        if not exists and not path.absolute().parent.is_dir():
            raise HistoryError(
                f"{path}: there is no folder '{path.parent}'; create it, or give another place"
            )
        uri = f"{path.absolute().as_uri()}?mode={'rwc' if create else 'rw'}"
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        if isinstance(error, HistoryError):
            raise
        raise HistoryError(f"{path}: cannot be opened ({reason}); give another place") from None

    def connect() -> sqlite3.Connection:
        connection = sqlite3.connect(
            uri, timeout=SETTINGS.file_s, isolation_level=None, uri=True, check_same_thread=False
        )
        connection.execute("PRAGMA foreign_keys = ON")
        # Committed data also survive a loss of power, not only the end of a process.
        connection.execute("PRAGMA synchronous = FULL")
        return connection

    engine = sa.create_engine("sqlite://", creator=connect, poolclass=QueuePool)

    @sa.event.listens_for(engine, "begin")
    def begin(connection: sa.Connection) -> None:
        writing = connection.get_execution_options().get("writing", False)
        if writing:
            connection.exec_driver_sql(f"PRAGMA busy_timeout = {1000 * SETTINGS.writer_s}")
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")

    return engine


def _of_server(address: Address) -> sa.Engine:
    """Return the engine of a PostgreSQL database."""
    if find_spec("psycopg") is None:
        raise HistoryError(
            "a history on PostgreSQL needs the library 'psycopg'; install it with: "
            "pip install 'emaphm[history]'"
        )
    assert address.url is not None  # noqa: S101 - for the type checker
    arguments: dict[str, Any] = {
        "connect_timeout": SETTINGS.host_s,
        "tcp_user_timeout": 1000 * SETTINGS.silence_s,
        "application_name": "emaphm",
    }
    # A connection that the server has closed is opened again.
    return sa.create_engine(address.url, connect_args=arguments, pool_pre_ping=True)


def _answer_in_time(answer: Callable[[], None], address: Address) -> None:
    """Call `answer` with a timeout of `answer_s`: a name server alone may take a minute."""
    failures: list[BaseException] = []

    def call() -> None:
        try:
            answer()
        except BaseException as error:  # noqa: BLE001 - raised below
            failures.append(error)

    # A daemon thread: it does not keep the process from ending if it hangs.
    thread = threading.Thread(target=call, daemon=True)
    thread.start()
    thread.join(SETTINGS.answer_s)
    if thread.is_alive():
        raise HistoryUnavailableError(
            f"{address.shown}: no answer within {SETTINGS.answer_s:g} s; check the address, and that the "
            "database runs there"
        )
    for failure in failures:
        raise failure


REMEDIES = {
    "is full": "free space there; what was added before is kept",
    "no space left": "free space there; what was added before is kept",
    "disk i/o error": "free space there, or give another place; what was added before is kept",
    "not a database": "give the file of a history",
    "malformed": "move it away, and restore a copy",
    "locked": "another program holds it; try again when that has ended",
    "lock timeout": "another program holds it; try again when that has ended",
    "readonly": "make the file and its folder writable, or give another place",
    "read-only": "make it writable, or give another place",
    "permission denied": "give a user who may write there",
    "unable to open": "the folder must be writable for reading too; make it so, or copy the history",
    "password": "check the user and the password",
    "does not exist": "create it, or give another one",
}
"""Remedies, by parts of the databases' own messages."""


def _complaint(address: Address, error: BaseException) -> HistoryError:
    """Return the error for a failed database, with its message and a remedy."""
    message = _message(error)
    lower = message.lower()
    remedy = next(
        (remedy for words, remedy in REMEDIES.items() if words in lower),
        "check the address, and that the database runs there",
    )
    return HistoryUnavailableError(f"{address.shown}: the database cannot be used ({message}); {remedy}")


def _message(error: BaseException) -> str:
    """Return the message of a database on one line."""
    return " ".join(str(error).split())[:LONGEST_REASON] or type(error).__name__
