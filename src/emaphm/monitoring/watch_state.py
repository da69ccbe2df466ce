"""How far a watcher is: the files it has done with, the rows it has judged, the events it has delivered.

It stands in the history itself, so that what is judged and what is known to be judged cannot fall apart. A
watcher is identified by a text (`emaphm.monitoring`).
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
"""What became of a file. Partly: something of it is judged and something refused; again: so by an earlier
run, what was refused is to be tried again. Changed: after something of it was judged. Tried: the process that
judged it has died of it once, it is tried once more; set aside: that happened twice, it is never tried
again."""

_Put = tuple[sa.Table, Mapping[str, Any], Mapping[str, Any]]
"""A row of a table: what it is found by, and what is written."""


@dataclass(frozen=True)
class WatchedFile:
    """A file as a watcher has left it: size [bytes], time of the last change, SHA-256 of its content.

    `outcome` is one of `OUTCOMES`. A movement of a stream that was tried has its number of rows as its size.
    """

    name: str
    size: int
    modified_ns: int
    digest: str
    outcome: str


@dataclass(frozen=True)
class RowsJudged:
    """Up to which time [s] of the flight at `hours` [h] the rows of a unit were judged."""

    hours: float
    time_s: float

    def covers(self, hours: float, time_s: float) -> bool:
        """Whether a row at these hours and this time was judged."""
        return hours < self.hours or (hours == self.hours and time_s <= self.time_s)


@dataclass(frozen=True, eq=False)
class WatchState:
    """What a history holds of one watcher; each method raises `HistoryError` where the database fails."""

    history: History
    watcher: str

    def files(self, names: Sequence[str]) -> dict[str, WatchedFile]:
        """Return what became of those of the files `names` that were judged or tried, by name."""
        held = {storable(name): name for name in names}
        query = sa.select(WATCHED_FILES).where(
            WATCHED_FILES.c.watcher == self.watcher, WATCHED_FILES.c.name.in_(list(held))
        )
        with self.history.database.reading() as connection:
            return {
                held[row.name]: WatchedFile(
                    held[row.name], row.size, row.modified_ns, row.digest, row.outcome
                )
                for row in connection.execute(query)
            }

    def forget_refused(self) -> None:
        """Let the files be tried again that were refused, or of which something was."""
        mine = WATCHED_FILES.c.watcher == self.watcher
        with self.history.writing() as connection:
            connection.execute(WATCHED_FILES.delete().where(mine, WATCHED_FILES.c.outcome == REFUSED))
            partly = WATCHED_FILES.update().where(mine, WATCHED_FILES.c.outcome == PARTLY)
            connection.execute(partly.values(outcome=AGAIN))

    def finish_file(self, file: WatchedFile, events: Sequence[Event] = ()) -> int:
        """Note what became of a file, and add events, in one step; return how many of these are new."""
        return self._put(events, _of_file(file))

    def rows_judged(self) -> dict[str, RowsJudged]:
        """Return by unit up to where its rows were judged."""
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
        """Note up to where the rows of a unit were judged, and add events; return how many are new.

        `tried` is what became of a movement that was tried before.
        """
        puts = [] if tried is None else [_of_file(tried)]
        if rows is not None:
            puts.append((WATCHED_ROWS, {"unit": unit}, {"hours": rows.hours, "time_s": rows.time_s}))
        return self._put(events, *puts)

    def undelivered(self, receiver: str, most: int) -> tuple[Event, ...]:
        """Return the first events of this watcher that a receiver has not been sent, `most` at most."""
        query = sa.select(DELIVERED.c.event_id).where(
            DELIVERED.c.watcher == self.watcher, DELIVERED.c.receiver == receiver
        )
        with self.history.database.reading() as connection:
            last = connection.execute(query).scalar()
            return read_events(connection, watcher=self.watcher, after=last, limit=most)

    def delivered(self, receiver: str, number: int) -> None:
        """Note that a receiver has been sent the events up to `number`."""
        self._put((), (DELIVERED, {"receiver": receiver}, {"event_id": number}))

    def skip_to_now(self, receiver: str) -> None:
        """Let a receiver that is new be sent only what comes from now on."""
        query = sa.select(DELIVERED.c.event_id).where(
            DELIVERED.c.watcher == self.watcher, DELIVERED.c.receiver == receiver
        )
        with self.history.database.reading() as connection:
            if connection.execute(query).first() is not None:
                return
            last = read_events(connection, watcher=self.watcher, newest_first=True, limit=1)
        self.delivered(receiver, (last[0].number or 0) if last else 0)

    def _put(self, events: Sequence[Event], *puts: _Put) -> int:
        """Add events and write rows, all or nothing; return how many events are new."""
        with self.history.writing() as connection:
            new = add_events(connection, events)
            for table, key, values in puts:
                every = {"watcher": self.watcher, **key}
                mine = [table.c[name] == value for name, value in every.items()]
                if not connection.execute(table.update().where(*mine).values(**values)).rowcount:
                    connection.execute(table.insert().values(**every, **values))
        return new


def _of_file(file: WatchedFile) -> _Put:
    values = {
        "size": file.size,
        "modified_ns": file.modified_ns,
        "digest": file.digest,
        "outcome": file.outcome,
    }
    return WATCHED_FILES, {"name": storable(file.name)}, values
