"""The queue of jobs: a table in a SQLite file, so that accepted uploads survive the end of the server."""

import json
import sqlite3
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from emaphm.errors import ServerError
from emaphm.history.timestamp import timestamp

WAITING, RUNNING, DONE, REFUSED, FAILED = "waiting", "running", "done", "refused", "failed"
STATES = (WAITING, RUNNING, DONE, REFUSED, FAILED)
"""States of a job. Refused: the recording or its fields cannot be used. Failed: its process was killed
twice, it took too long or too much memory, or an unexpected error occurred."""

AGAIN = "again"
"""Outcome of a job or a prognosis during which the history was not available: it waits again.

This is not counted as killed.
"""

FORM = 1
"""Version of the table; a file of another version is refused."""

TAKEN = """
WITH of_units AS (
    SELECT id, state, json_extract(request, '$.unit') AS unit, json_extract(request, '$.hours') AS hours
    FROM jobs WHERE state IN (:waiting, :running)
)
UPDATE jobs SET state = :running WHERE id = (
    SELECT id FROM of_units WHERE state = :waiting
    AND unit NOT IN (SELECT unit FROM of_units WHERE state = :running)
    AND unit NOT IN (SELECT value FROM json_each(:arriving))
    ORDER BY min(id) OVER (PARTITION BY unit), hours, id LIMIT 1
) RETURNING *
"""
"""Query that takes the next job: of the unit that has waited longest, the job with the lowest hours."""

MOST_QUIETS = 30
"""Longest time for which successive uploads of a unit delay its jobs, in multiples of the quiet time."""

OF_UNIT = "SELECT id FROM jobs WHERE state IN (?, ?) AND json_extract(request, '$.unit') = ? LIMIT 1"

TABLE = """
CREATE TABLE IF NOT EXISTS jobs (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    state TEXT NOT NULL,
    request TEXT NOT NULL,
    file TEXT NOT NULL,
    kills INTEGER NOT NULL DEFAULT 0,
    message TEXT NOT NULL DEFAULT '',
    result TEXT NOT NULL DEFAULT '{}',
    added_at TEXT NOT NULL,
    ended_at TEXT
)
"""


@dataclass(frozen=True)
class Job:
    """An upload in the queue.

    Attributes
    ----------
    state
        One of `STATES`.
    request
        Fields of the upload: unit, hours and others.
    file
        Name of the recording in the folder of uploads, assigned by the server.
    kills
        Number of worker processes that have died during the job.
    message
        Reason why it was refused or has failed.
    result
        Result of the diagnosis, if the job is done.
    """

    id: int
    state: str
    request: dict[str, Any]
    file: str = field(repr=False)
    kills: int
    message: str
    result: dict[str, Any]
    added_at: str
    ended_at: str | None

    @property
    def is_over(self) -> bool:
        """Whether the job has ended."""
        return self.state in {DONE, REFUSED, FAILED}


class Queue:
    """Queue of jobs, those of a unit in the order of hours; changes are on disk when a method returns."""

    def __init__(self, file: Path) -> None:
        try:
            self._connection = sqlite3.connect(file, isolation_level=None, check_same_thread=False)
            self._connection.row_factory = sqlite3.Row
            self._connection.execute("PRAGMA journal_mode = WAL")
            self._connection.execute("PRAGMA synchronous = FULL")
            form = self._connection.execute("PRAGMA user_version").fetchone()[0]
            if form not in {0, FORM}:
                raise ServerError(f"{file}: another version of emaphm made this queue; give another --work")
            self._connection.execute(TABLE)
            self._connection.execute(f"PRAGMA user_version = {FORM}")
        except sqlite3.Error as error:
            raise ServerError(f"{file}: cannot be used as a queue ({error}); give another --work") from None
        self._file = file
        self._lock = threading.Lock()
        self._arrivals: dict[str, tuple[float, float]] = {}  # first and last arrival of a unit's new uploads

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._connection.close()

    def add(self, request: dict[str, Any], file: str) -> int:
        """Add a job; return its number."""
        with self._locked_connection() as connection:
            cursor = connection.execute(
                "INSERT INTO jobs (state, request, file, added_at) VALUES (?, ?, ?, ?)",
                (WAITING, json.dumps(request), file, timestamp()),
            )
            now, unit = time.monotonic(), request["unit"]
            self._arrivals[unit] = (self._arrivals.get(unit, (now, now))[0], now)
        return int(cursor.lastrowid or 0)

    def take(self, quiet_s: float = 0.0) -> Job | None:
        """Return the next job, marked as running, or None if there is none.

        Of each unit, the job with the lowest hours is next, and no job while another of the unit is running,
        because the events of a recording depend on the recordings before it. For the same reason, no job is
        taken of a unit whose last job was added less than `quiet_s` [s] ago: files that are sent together
        arrive in any order.
        """
        with self._locked_connection() as connection:
            names = {"waiting": WAITING, "running": RUNNING, "arriving": json.dumps(self._arriving(quiet_s))}
            row = connection.execute(TAKEN, names).fetchone()
        return None if row is None else _job(row)

    def _arriving(self, quiet_s: float) -> list[str]:
        """Return the units of which further uploads are expected, and remove the times of the others."""
        now = time.monotonic()
        self._arrivals = {
            unit: (first, last)
            for unit, (first, last) in self._arrivals.items()
            if now - last < quiet_s and now - first < MOST_QUIETS * quiet_s
        }
        return list(self._arrivals)

    def end(self, job: int, state: str, message: str, result: dict[str, Any]) -> None:
        """Write the final state of a job."""
        with self._locked_connection() as connection:
            connection.execute(
                "UPDATE jobs SET state = ?, message = ?, result = ?, ended_at = ? WHERE id = ?",
                (state, message, json.dumps(result), timestamp(), job),
            )

    def again(self, job: int) -> None:
        """Set a job back to waiting."""
        with self._locked_connection() as connection:
            connection.execute("UPDATE jobs SET state = ? WHERE id = ?", (WAITING, job))

    def killed(self, job: int) -> int:
        """Set a job whose process has died back to waiting; return how often its process has died."""
        with self._locked_connection() as connection:
            row = connection.execute(
                "UPDATE jobs SET state = ?, kills = kills + 1 WHERE id = ? RETURNING kills", (WAITING, job)
            ).fetchone()
        return int(row["kills"])

    def resume(self) -> int:
        """Set the jobs that were running when the server ended back to waiting; return their number."""
        with self._locked_connection() as connection:
            return connection.execute(
                "UPDATE jobs SET state = ? WHERE state = ?", (WAITING, RUNNING)
            ).rowcount

    def job(self, number: int) -> Job | None:
        """Return the job with this number, None if there is none."""
        with self._locked_connection() as connection:
            row = connection.execute("SELECT * FROM jobs WHERE id = ?", (number,)).fetchone()
        return None if row is None else _job(row)

    def jobs(self, limit: int, before: int | None = None) -> list[Job]:
        """Return at most `limit` jobs with numbers below `before`, the newest first."""
        with self._locked_connection() as connection:
            rows = connection.execute(
                "SELECT * FROM jobs WHERE id < ? ORDER BY id DESC LIMIT ?",
                (2**62 if before is None else before, limit),
            ).fetchall()
        return [_job(row) for row in rows]

    def total(self) -> int:
        """Return the number of all jobs."""
        with self._locked_connection() as connection:
            return int(connection.execute("SELECT count(*) FROM jobs").fetchone()[0])

    def waiting(self) -> int:
        """Return the number of jobs that wait or run."""
        with self._locked_connection() as connection:
            row = connection.execute(
                "SELECT count(*) FROM jobs WHERE state IN (?, ?)", (WAITING, RUNNING)
            ).fetchone()
        return int(row[0])

    def has_unit(self, unit: str) -> bool:
        """Return whether a job of a unit waits or runs."""
        with self._locked_connection() as connection:
            row = connection.execute(OF_UNIT, (WAITING, RUNNING, unit)).fetchone()
        return row is not None

    @contextmanager
    def _locked_connection(self) -> Iterator[sqlite3.Connection]:
        try:
            with self._lock:
                yield self._connection
        except sqlite3.Error as error:
            raise ServerError(
                f"{self._file}: the queue cannot be used ({error}); free space there, then try again"
            ) from None


def _job(row: sqlite3.Row) -> Job:
    return Job(
        id=row["id"],
        state=row["state"],
        request=json.loads(row["request"]),
        file=row["file"],
        kills=row["kills"],
        message=row["message"],
        result=json.loads(row["result"]),
        added_at=row["added_at"],
        ended_at=row["ended_at"],
    )
