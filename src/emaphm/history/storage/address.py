"""Address of a history: a SQLite file, or the URL of a PostgreSQL database."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import sqlalchemy as sa
from sqlalchemy.exc import ArgumentError

from emaphm.errors import HistoryError

POSTGRESQL = ("postgresql", "postgres", "postgresql+psycopg")


@dataclass(frozen=True)
class Address:
    """A file or a URL; `shown` is its text in messages, without a password."""

    shown: str
    file: Path | None = None
    url: sa.URL | None = None

    @classmethod
    def of(cls, where: str | Path) -> Self:
        """Return the address given by a user: the path of a file, sqlite:///PATH or postgresql://….

        Raises
        ------
        HistoryError
            The URL cannot be read, or names another kind of database.
        """
        text = str(where)
        if "\0" in text:
            raise HistoryError(f"{text!r}: a history cannot have this name; take the null character out")
        if "://" not in text:
            return cls(text, file=Path(text))
        try:
            url = sa.make_url(text)
        except (ArgumentError, ValueError):
            # The message does not contain the URL, which may contain a password.
            raise HistoryError(
                "the database's URL cannot be read; give postgresql://USER@HOST:PORT/DATABASE, or a file"
            ) from None
        if url.drivername == "sqlite":
            if not url.database or url.database == ":memory:":
                raise HistoryError(f"'{text}' names no file; give the path of one")
            return cls(url.database, file=Path(url.database))
        if url.drivername not in POSTGRESQL:
            raise HistoryError(
                f"'{url.drivername}://' is no database that a history can be in; give a file, or "
                "postgresql://USER@HOST:PORT/DATABASE"
            )
        if "@" in (url.host or ""):
            raise HistoryError("the database's URL has an '@' too many; write one in a password as %40")
        # Shown without its query, which may also contain a password.
        return cls(
            url.set(query={}).render_as_string(hide_password=True),
            url=url.set(drivername="postgresql+psycopg"),
        )

    @property
    def remedy(self) -> str:
        """Remedy for a missing history."""
        return (
            "begin one by its first recording: emaphm history add RECORDING --unit SERIAL --hours HOURS "
            f"--db {shlex.quote(self.shown)}; or give another --db"
        )

    @property
    def where(self) -> str:
        """The text from which `of` makes this address; it may contain a password."""
        if self.url is None:
            assert self.file is not None  # noqa: S101 - it is one of the two
            return str(self.file.absolute())
        return self.url.render_as_string(hide_password=False)
