"""Store of results on disk: one row per task, written atomically.

One SQLite file in rollback-journal mode, written by the process that distributes the tasks. It replaced one
Parquet file per task; comparison with 10,000 results of 10 kB on a shared disk:

    read all                2.1 s, damaged and changed rows detected (Parquet: 4.5 s, damage detected)
    write one               1.5 to 7 ms, safe against loss of power  (Parquet: 0.7 to 1.0 ms, not safe)
    files                   1                                        (Parquet: 10,000)

A killed process leaves a journal, which the next reader or writer rolls back. SQLite's locks serialise two
writers, and allow readers. Write-ahead logging is not used, because it needs shared memory and does not work
on NFS. The rollback journal needs byte-range locks on NFS, like the lock file of a study.
"""

import hashlib
import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from emaphm.errors import ExecutionError, OutputError
from emaphm.execution.tasks import Outcome, Task
from emaphm.output_files import OTHERWISE

PATIENCE_S = 60.0
"""Longest wait for another writing process [s]."""

REMEDIES = {
    "readonly": "make the file and its folder writable, or give another place",
    "unable to open": "create the folder and make it writable, or give another place",
    "locked": "another process writes there; try again when that has ended",
}
"""Advice by a part of SQLite's error message."""

TABLES = """\
CREATE TABLE IF NOT EXISTS results (
    key TEXT PRIMARY KEY, result TEXT, wall_seconds REAL, cpu_seconds REAL, digest TEXT
);
CREATE TABLE IF NOT EXISTS sessions (id TEXT PRIMARY KEY, seconds REAL);
"""


@dataclass(frozen=True)
class ResultStore:
    """File of results at `path`; it is created with the first result."""

    path: Path

    @contextmanager
    def writing(self) -> Iterator["Writer"]:
        """Open the file for writing and yield its writer.

        Raises
        ------
        OutputError
            The file cannot be created or written.
        ExecutionError
            The file at `path` is no file of results, or is damaged.
        """
        with self._errors(), closing(self._connect("rwc")) as connection:
            _check(connection)
            # Ten times as fast as creating and removing a journal for each result.
            connection.execute("PRAGMA journal_mode = PERSIST")
            connection.executescript(TABLES)
            try:
                yield Writer(connection)
            finally:
                with suppress(sqlite3.Error):
                    connection.execute("PRAGMA journal_mode = DELETE")

    def read(self, tasks: Sequence[Task]) -> tuple[dict[int, Outcome], tuple[int, ...]]:
        """Return the stored outcomes of `tasks` by index, and the indices of tasks with damaged rows.

        Raises
        ------
        ExecutionError
            The file is damaged as a whole, or is no file of results.
        """
        outcomes, damaged = {}, []
        for index, outcome in self._outcomes(tasks):
            if outcome is None:
                damaged.append(index)
            else:
                outcomes[index] = outcome
        return outcomes, tuple(sorted(damaged))

    def finished(self, tasks: Sequence[Task]) -> set[int]:
        """Return the indices of `tasks` with an undamaged stored result; raises the errors of `read`."""
        return {index for index, outcome in self._outcomes(tasks) if outcome is not None}

    def outcome(self, task: Task) -> Outcome:
        """Return the outcome of a `task` that `finished` contains; raises the errors of `read`."""
        for _, outcome in self._outcomes([task], " WHERE key = ?", (task.key,)):
            if outcome is not None:
                return outcome
        raise ExecutionError(f"{self.path}: the result of {task.name or task.key} is gone; start again")

    def _outcomes(
        self, tasks: Sequence[Task], where: str = "", values: tuple[str, ...] = ()
    ) -> Iterator[tuple[int, Outcome | None]]:
        """Yield index and outcome of each stored task; the outcome is None if the row is damaged."""
        if not self.path.exists():
            return
        by_key = {task.key: task.index for task in tasks}
        with self._errors(), closing(self._connect("rw")) as connection:
            if not where:
                _check(connection)
            for key, text, wall, cpu, digest in _rows(connection, where, values):
                if key not in by_key:
                    continue
                undamaged = digest == _digest(key, text, wall, cpu)
                index = by_key[key]
                yield index, Outcome(index, json.loads(text), "", wall, cpu) if undamaged else None

    def elapsed_seconds(self) -> float:
        """Return the total duration of the sessions [s], without the pauses between them."""
        if not self.path.exists():
            return 0.0
        with self._errors(), closing(self._connect("rw")) as connection:
            try:
                total = connection.execute("SELECT TOTAL(seconds) FROM sessions").fetchone()[0]
            except sqlite3.OperationalError:  # the process was killed before its first result
                return 0.0
        return float(total)

    def _connect(self, mode: str) -> sqlite3.Connection:
        # Mode "rw" also for reading, so that the journal of a killed writer is rolled back.
        address = f"{self.path.absolute().as_uri()}?mode={mode}"
        # Each statement is its own transaction, except between BEGIN and COMMIT.
        return sqlite3.connect(address, timeout=PATIENCE_S, isolation_level=None, uri=True)

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.OperationalError as error:
            remedy = next((remedy for words, remedy in REMEDIES.items() if words in str(error)), OTHERWISE)
            raise OutputError(f"{self.path}: cannot be written or read ({error}); {remedy}") from None
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            raise ExecutionError(
                f"{self.path}: is damaged ({error}); move it away, and its results are computed again"
            ) from None


@dataclass(frozen=True)
class Writer:
    """Writer of results to an open store."""

    connection: sqlite3.Connection

    def keep(self, task: Task, outcome: Outcome, session: str, elapsed_s: float) -> None:
        """Store a result, replacing that of the same key, and the time `elapsed_s` of the `session`."""
        text = json.dumps(outcome.result)
        wall, cpu = outcome.wall_seconds, outcome.cpu_seconds
        row = (task.key, text, wall, cpu, _digest(task.key, text, wall, cpu))
        # One transaction for both rows.
        self.connection.execute("BEGIN IMMEDIATE")
        try:
            self.connection.execute("INSERT OR REPLACE INTO results VALUES (?, ?, ?, ?, ?)", row)
            self.connection.execute("INSERT OR REPLACE INTO sessions VALUES (?, ?)", (session, elapsed_s))
            self.connection.execute("COMMIT")
        except BaseException:
            if self.connection.in_transaction:
                self.connection.execute("ROLLBACK")
            raise


def _check(connection: sqlite3.Connection) -> None:
    """Raise an error if the structure of the file is damaged, because some rows could not be read."""
    answer = str(connection.execute("PRAGMA quick_check(1)").fetchone()[0])
    if answer != "ok":
        raise sqlite3.DatabaseError(" ".join(answer.split()))


def _rows(connection: sqlite3.Connection, where: str, values: tuple[str, ...]) -> Iterator[tuple[Any, ...]]:
    columns = "key, result, wall_seconds, cpu_seconds, digest"
    try:
        yield from connection.execute(f"SELECT {columns} FROM results{where}", values)  # noqa: S608 - ours
    except sqlite3.OperationalError as error:
        # A process was killed before it created the tables.
        if "no such table" not in str(error):
            raise


def _digest(key: Any, text: Any, wall: Any, cpu: Any) -> str:
    """Return a digest of a row's values, to detect values that were changed or copied to another key."""
    return hashlib.sha256(repr((key, text, wall, cpu)).encode(errors="replace")).hexdigest()[:32]
