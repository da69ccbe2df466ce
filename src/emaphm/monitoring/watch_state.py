"""Progress of a watcher in the history: files and rows that it has judged, events that it has delivered.

It is stored in the history itself, so that it is always consistent with the judged recordings. A watcher is
identified by a text (`WatchTask.watcher`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa

from emaphm.history.events import Event, add_events, read_events
from emaphm.history.history import History
from emaphm.history.storage.tables import DELIVERED, WATCHED_FILES, WATCHED_ROWS
from emaphm.history.writing import storable

JUDGED, PARTLY, AGAIN, REFUSED, CHANGED, TRIED, SET_ASIDE = OUTCOMES = (
    "judged",
    "partly",
    "again",
    "refused",
    "changed",
    "tried",
    "set aside",
)
"""Outcomes of a file. Partly: some parts are judged and some refused; again: partly in an earlier run, the
refused parts are tried again. Changed: changed after a part of it was judged. Tried: the process that judged
it has died once, it is tried once more; set aside: this has happened twice, it is never tried again."""

_Put = tuple[sa.Table, Mapping[str, Any], Mapping[str, Any]]
"""A row to write: its table, the key by which it is found, and the values."""


@dataclass(frozen=True)
class WatchedFile:
    """A file that a watcher has processed: size [bytes], modification time [ns], SHA-256 of its content.

    `outcome` is one of `OUTCOMES`. For a movement of a stream that was tried, `size` is its number of rows.
    """

    name: str
    size: int
    modified_ns: int
    digest: str
    outcome: str


@dataclass(frozen=True)
class RowsJudged:
    """Time [s] in the flight at `hours` [h] up to which the rows of a unit were judged."""

    hours: float
    time_s: float

    def covers(self, hours: float, time_s: float) -> bool:
        """Return whether a row at these hours and this time was judged."""
        return hours < self.hours or (hours == self.hours and time_s <= self.time_s)


@dataclass(frozen=True, eq=False)
class WatchState:
    """State of one watcher in a history; each method raises `HistoryError` if the database fails."""

    history: History
    watcher: str

    def files(self, names: Sequence[str]) -> dict[str, WatchedFile]:
        """Return the outcomes of the files `names` that were judged or tried, by name."""
        original = {storable(name): name for name in names}
        query = sa.select(WATCHED_FILES).where(
            WATCHED_FILES.c.watcher == self.watcher, WATCHED_FILES.c.name.in_(list(original))
        )
        with self.history.database.reading() as connection:
            return {
                original[row.name]: WatchedFile(
                    original[row.name], row.size, row.modified_ns, row.digest, row.outcome
                )
                for row in connection.execute(query)
            }

    def forget_refused(self) -> None:
        """Mark the files that were refused, completely or partly, for a new attempt."""
        mine = WATCHED_FILES.c.watcher == self.watcher
        with self.history.writing() as connection:
            connection.execute(WATCHED_FILES.delete().where(mine, WATCHED_FILES.c.outcome == REFUSED))
            partly = WATCHED_FILES.update().where(mine, WATCHED_FILES.c.outcome == PARTLY)
            connection.execute(partly.values(outcome=AGAIN))

    def finish_file(self, file: WatchedFile, events: Sequence[Event] = ()) -> int:
        """Write the outcome of a file and add events, in one transaction; return the number of new events."""
        return self._put(events, _file_row(file))

    def rows_judged(self) -> dict[str, RowsJudged]:
        """Return the judged rows by unit."""
        query = sa.select(WATCHED_ROWS).where(WATCHED_ROWS.c.watcher == self.watcher)
        with self.history.database.reading() as connection:
            return {row.unit: RowsJudged(row.hours, row.time_s) for row in connection.execute(query)}

    def finish_rows(
        self,
        unit: str,
        rows: RowsJudged | None,
        events: Sequence[Event] = (),
        tried: WatchedFile | None = None,
    ) -> int:
        """Write the judged rows of a unit and add events in one transaction; return the number of new events.

        `tried` is the outcome of a movement that was tried before.
        """
        puts = [] if tried is None else [_file_row(tried)]
        if rows is not None:
            puts.append((WATCHED_ROWS, {"unit": unit}, {"hours": rows.hours, "time_s": rows.time_s}))
        return self._put(events, *puts)

    def undelivered(self, receiver: str, most: int) -> tuple[Event, ...]:
        """Return at most `most` events of this watcher that were not sent to a receiver, the oldest first."""
        with self.history.database.reading() as connection:
            last = self._last_delivered(connection, receiver)
            return read_events(connection, watcher=self.watcher, after=last, limit=most)

    def delivered(self, receiver: str, number: int) -> None:
        """Note that the events up to `number` were sent to a receiver."""
        self._put((), (DELIVERED, {"receiver": receiver}, {"event_id": number}))

    def skip_to_now(self, receiver: str) -> None:
        """Mark all present events as sent to a receiver if it is new."""
        with self.history.database.reading() as connection:
            if self._last_delivered(connection, receiver) is not None:
                return
            last = read_events(connection, watcher=self.watcher, newest_first=True, limit=1)
        self.delivered(receiver, (last[0].number or 0) if last else 0)

    def _last_delivered(self, connection: sa.Connection, receiver: str) -> int | None:
        """Return the number of the last event that was sent to a receiver, None if the receiver is new."""
        own = DELIVERED.c.watcher == self.watcher, DELIVERED.c.receiver == receiver
        return connection.execute(sa.select(DELIVERED.c.event_id).where(*own)).scalar()

    def _put(self, events: Sequence[Event], *puts: _Put) -> int:
        """Add events and write rows in one transaction; return the number of new events."""
        with self.history.writing() as connection:
            new = add_events(connection, events)
            for table, key, values in puts:
                full_key = {"watcher": self.watcher, **key}
                own_row = [table.c[name] == value for name, value in full_key.items()]
                if not connection.execute(table.update().where(*own_row).values(**values)).rowcount:
                    connection.execute(table.insert().values(**full_key, **values))
        return new


def _file_row(file: WatchedFile) -> _Put:
    values = {
        "size": file.size,
        "modified_ns": file.modified_ns,
        "digest": file.digest,
        "outcome": file.outcome,
    }
    return WATCHED_FILES, {"name": storable(file.name)}, values
