"""`python -m tests.history.faults --kills 50 [--db URL]`: killed and concurrent writers of a history.

Prints the result; the exit code is 1 if an acknowledged recording is lost, duplicated or incomplete.
"""

import argparse
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import sqlalchemy as sa

from emaphm.history import History
from emaphm.history.storage.tables import DIAGNOSES, FLIGHTS, RECORDINGS, UNITS
from emaphm.recording.content import recording_hash

from . import made_up
from .nursery import Job, Nursery, entry, nursery

MOST_RECORDINGS = 12
"""Recordings that a writer has to add; it is killed after some of them."""


EARLY = 4
"""Number of kills right after the start, while the tables are created."""

PATIENCE_S = 60
"""Longest wait for a writer to start on a busy machine."""


def acknowledged(path: Path) -> list[int]:
    """Return the numbers that writers have acknowledged."""
    return [int(line) for line in path.read_text().splitlines() if line != "half"] if path.exists() else []


def held(where: str) -> list[int]:
    """Return the numbers of the recordings in a history, after checking that each recording is complete."""
    with History.open(where) as history:
        with history.database.reading() as connection:
            counts = [
                connection.execute(sa.select(sa.func.count()).select_from(table)).scalar_one()
                for table in (RECORDINGS, DIAGNOSES)
            ]
            without = connection.execute(
                sa.select(sa.func.count())
                .select_from(UNITS)
                .outerjoin(FLIGHTS, FLIGHTS.c.unit_id == UNITS.c.id)
                .outerjoin(RECORDINGS, RECORDINGS.c.flight_id == FLIGHTS.c.id)
                .where(RECORDINGS.c.id.is_(None))
            ).scalar_one()
        kept = [(unit, diagnosis) for unit in history.units() for diagnosis in unit.diagnoses()]
    if counts != [len(kept), len(kept)] or without:
        raise AssertionError(f"{counts} recordings and diagnoses, {without} without, {len(kept)} readable")
    numbers = []
    for unit, diagnosis in kept:
        number = int(diagnosis.recording.removesuffix(".csv"))
        expected = (entry(number).unit, recording_hash(made_up.recording(number)), entry(number).hours)
        if (unit.serial_number, diagnosis.recording_hash, diagnosis.hours) != expected:
            raise AssertionError(f"recording {number} is not where it was put")
        if (diagnosis.vector != made_up.diagnosis(number).faults.vector).any():
            raise AssertionError(f"recording {number} has another's estimates")
        numbers.append(number)
    return sorted(numbers)


def kill_writers(home: Nursery, where: str, folder: Path, kills: int, seed: int = 0) -> int:
    """Kill writers one after the other; return the number of kills in the middle of a writer's work.

    Raises
    ------
    AssertionError
        An acknowledged recording is lost or duplicated, or another recording is incomplete.
    """
    random_numbers, notes = random.Random(seed), folder / "acknowledged"
    halfway = 0
    for kill in range(kills):
        before = acknowledged(notes)
        first = max(before, default=-1) + 1
        job = Job(where, str(notes), list(range(first, first + MOST_RECORDINGS)))
        child = home.start(job)
        if kill >= EARLY:
            _wait_for(notes, len(before) + random_numbers.randrange(4))
        # Opening, checking and writing take some milliseconds each, so kills fall into all three.
        time.sleep(random_numbers.uniform(0.0, 0.03))
        os.kill(child, signal.SIGKILL)
        home.wait(child)
        after = acknowledged(notes)
        halfway += 0 < len(after) - len(before) < MOST_RECORDINGS
        _check(where, after, kill)
    last = max(acknowledged(notes), default=-1) + 2
    child = home.start(Job(where, str(notes), list(range(last))))  # all recordings once more
    if home.wait(child) != 0 or held(where) != list(range(last)):
        raise AssertionError("what the kills left cannot be completed")
    return halfway


def _wait_for(notes: Path, count: int) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while len(acknowledged(notes)) < count:
        if time.monotonic() > deadline:
            raise AssertionError(f"no writer added anything within {PATIENCE_S} s")
        time.sleep(0.001)


def _check(where: str, after: Sequence[int], kill: int) -> None:
    if not after and not _is_made(where):
        return  # killed before the history was created
    numbers = held(where)
    if (
        len(set(numbers)) < len(numbers)
        or not set(after) <= set(numbers)
        or len(numbers) > len(set(after)) + 1
    ):
        raise AssertionError(f"kill {kill}: {after} were acknowledged, {numbers} are there")


def _is_made(where: str) -> bool:
    from emaphm.errors import HistoryError

    try:
        History.open(where).close()
    except HistoryError:
        return False
    return True


def write_at_once(home: Nursery, where: str, folder: Path, writers: int = 8, each: int = 12) -> None:
    """Let writers add recordings to a new history concurrently; neighbours share half of their recordings.

    Raises
    ------
    AssertionError
        A writer failed, or a recording is lost or duplicated.
    """
    jobs = [
        Job(where, str(folder / f"writer {i}"), list(range(i * each // 2, i * each // 2 + each)))
        for i in range(writers)
    ]
    children = [home.start(job) for job in jobs]
    if {home.wait(child) for child in children} != {0}:
        raise AssertionError("a writer failed")
    added = sorted({number for job in jobs for number in job.numbers})
    if held(where) != added:
        raise AssertionError(f"{held(where)} are there, {added} were added")


def main() -> int:
    """Run the checks and print their durations."""
    parser = argparse.ArgumentParser(prog="python -m tests.history.faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--writers", type=int, default=8)
    parser.add_argument(
        "--db", help="an empty PostgreSQL database, whose schemas 'kills' and 'writers' are used"
    )
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, nursery() as home:
        places = [str(Path(folder) / "kills.sqlite"), str(Path(folder) / "writers.sqlite")]
        if arguments.db:
            places = [_schema(arguments.db, name) for name in ("kills", "writers")]
        began = time.monotonic()
        halfway = kill_writers(home, places[0], Path(folder), arguments.kills)
        took = time.monotonic() - began
        print(
            f"{arguments.kills} kills, {halfway} of a writer halfway, in {took:.1f} s: nothing lost or twice"
        )
        began = time.monotonic()
        write_at_once(home, places[1], Path(folder), arguments.writers)
        took = time.monotonic() - began
        print(f"{arguments.writers} writers at once, in {took:.1f} s: nothing lost or twice")
    return 0


def _schema(url: str, name: str) -> str:
    engine = sa.create_engine(sa.make_url(url).set(drivername="postgresql+psycopg"))
    with engine.begin() as connection:
        connection.exec_driver_sql(f"DROP SCHEMA IF EXISTS {name} CASCADE")
        connection.exec_driver_sql(f"CREATE SCHEMA {name}")
    engine.dispose()
    own = sa.make_url(url).update_query_dict({"options": f"-csearch_path={name}"})
    return own.render_as_string(hide_password=False)


if __name__ == "__main__":
    sys.exit(main())
