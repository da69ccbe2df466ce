"""`python -m tests.history.nursery`: forks writers of a history for tests that kill these writers.

A fork of a Python process with all modules loaded takes 1 ms, a new start 2 s. An order is a line of JSON
with a `Job`; the answer is the writer's process id. For a process id, the answer is its wait status.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy.schema import CreateTable

from emaphm.history import Entry, History
from emaphm.history.storage.tables import METADATA

from . import made_up

FLIGHT_H = 10.0
"""Flight hours between two recordings of a unit."""

UNITS = 4


@dataclass(frozen=True)
class Job:
    """Order of a writer: add the recordings with these `numbers`, and note each added one in `acknowledged`.

    With `pause_at`, the writer notes "half" and sleeps within the transaction of that number. With `die_at`,
    it kills itself before the statement of that count from the opening.
    """

    where: str
    acknowledged: str
    numbers: Sequence[int]
    pause_at: int | None = None
    die_at: int | None = None


def entry(number: int) -> Entry:
    """Return unit and hours of a recording's number; recordings of a unit may be added in any order."""
    return Entry(f"S{number % UNITS}", made_up.PART, FLIGHT_H * (number // UNITS), number // UNITS, late=True)


def write(job: Job) -> None:
    """Add the recordings of a job."""
    note = os.open(job.acknowledged, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    state = {"number": -1, "statements": 0}

    @sa.event.listens_for(sa.Engine, "before_cursor_execute")
    def count(*_: Any) -> None:
        state["statements"] += 1
        if state["statements"] == job.die_at:
            os.kill(os.getpid(), signal.SIGKILL)

    @sa.event.listens_for(sa.Engine, "after_cursor_execute")
    def pause(_connection: Any, _cursor: Any, statement: str, *_: Any) -> None:
        if state["number"] == job.pause_at and statement.startswith("INSERT INTO diagnoses"):
            os.write(note, b"half\n")
            time.sleep(600)

    with History.open(job.where, create=True) as history:
        for number in job.numbers:
            state["number"] = number
            history.add(entry(number), made_up.recording(number), made_up.diagnosis(number))
            os.write(note, f"{number}\n".encode())


@dataclass(frozen=True)
class Nursery:
    """A process that forks writers."""

    process: "subprocess.Popen[str]"

    def start(self, job: Job) -> int:
        """Return the process id of a new writer for the job."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(asdict(job)) + "\n")
        self.process.stdin.flush()
        return int(self._line())

    def wait(self, child: int) -> int:
        """Return the wait status of a writer: 0 if it has added all recordings, 9 if it was killed."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{child}\n")
        self.process.stdin.flush()
        return int(self._line())

    def _line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline()


@contextlib.contextmanager
def nursery() -> Iterator[Nursery]:
    """Yield a nursery, which is ended with the block."""
    root = Path(__file__).resolve().parents[2]
    path = os.pathsep.join([str(root / "src"), str(root), os.environ.get("PYTHONPATH", "")])
    with subprocess.Popen(
        [sys.executable, "-W", "ignore", "-m", "tests.history.nursery"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
    ) as process:
        yield Nursery(process)
        process.kill()


def warm_up() -> None:
    """Do the steps that are slow the first time: create a history, add to it, compile PostgreSQL tables."""
    with (
        tempfile.TemporaryDirectory() as folder,
        History.open(Path(folder) / "history.sqlite", create=True) as history,
    ):
        history.add(entry(0), made_up.recording(0), made_up.diagnosis(0))
    server = sa.create_engine("postgresql+psycopg://")  # never connected
    for table in METADATA.sorted_tables:
        CreateTable(table).compile(server)


def main() -> None:
    """Fork a writer for each job on stdin, and wait for a writer for each process id on stdin."""
    warm_up()  # else each writer would load the modules itself; all files are closed before the first fork
    for line in sys.stdin:
        order = json.loads(line)
        if isinstance(order, int):
            print(os.waitpid(order, 0)[1], flush=True)
            continue
        child = os.fork()
        if not child:
            ended = 1
            try:
                write(Job(**order))
                ended = 0
            finally:
                os._exit(ended)
        print(child, flush=True)


if __name__ == "__main__":
    main()
