"""Killed writers, writers at once, full disks, interrupted migrations: nothing acknowledged is lost."""

import os
import resource
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import sqlalchemy as sa

from emaphm.errors import HistoryError
from emaphm.history import History, Removal
from emaphm.history.columns import columns_of
from emaphm.history.fingerprint import description_of
from emaphm.history.storage import schema
from emaphm.history.storage.address import Address
from emaphm.history.storage.database import Database
from emaphm.history.storage.schema import ADVISORY_LOCK, KNOWN, NEWEST, VERSION, upgrade
from emaphm.history.storage.tables import DESCRIPTIONS, DIAGNOSES, FLIGHTS, METADATA, RECORDINGS, UNITS
from emaphm.recording.content import recording_hash

from . import made_up
from .faults import acknowledged, held, kill_writers, write_at_once
from .made_up import diagnosis, entry, recording
from .nursery import Job, Nursery, nursery

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork and SIGKILL")

KILLS = 6
"""`python -m tests.history.faults` makes 50."""

MOST_STATEMENTS = 60
"""More than opening an old history takes."""

PATIENCE_S = 60


@pytest.fixture(scope="module")
def home() -> Iterator[Nursery]:
    """Return what forks writers."""
    with nursery() as started:
        yield started


def test_killed_writers_lose_nothing(home: Nursery, address: str, tmp_path: Path) -> None:
    assert kill_writers(home, address, tmp_path, KILLS) > 0


def test_a_kill_within_a_transaction_leaves_nothing(home: Nursery, address: str, tmp_path: Path) -> None:
    notes = tmp_path / "acknowledged"
    child = home.start(Job(address, str(notes), [0, 1, 2], pause_at=1))
    deadline = time.monotonic() + PATIENCE_S
    while not notes.exists() or "half" not in notes.read_text():
        assert time.monotonic() < deadline
        time.sleep(0.005)
    # A reader does not wait for the writer, nor see what it has not finished.
    assert held(address) == [0]
    os.kill(child, signal.SIGKILL)
    assert home.wait(child) == signal.SIGKILL
    assert acknowledged(notes) == [0]
    assert held(address) == [0]
    with History.open(address) as history:
        assert [unit.serial_number for unit in history.units()] == ["S0"]
    assert home.wait(home.start(Job(address, str(notes), [0, 1, 2]))) == 0
    assert held(address) == [0, 1, 2]


def test_eight_writers_at_once_lose_nothing(home: Nursery, address: str, tmp_path: Path) -> None:
    write_at_once(home, address, tmp_path, each=3)


def test_a_file_is_alone_when_all_have_closed_it(tmp_path: Path) -> None:
    with History.open(tmp_path / "history.sqlite", create=True) as history:
        history.add(entry(), recording(1), diagnosis(1))
    assert [path.name for path in tmp_path.iterdir()] == ["history.sqlite"]


def add_many(path: Path, numbers: range) -> None:
    with History.open(path) as history:
        for number in numbers:
            history.add(entry(hours=10.0 * number), recording(number), diagnosis(number))


def test_of_a_folder_that_cannot_be_written_to_it_is_said_that_it_must_be(tmp_path: Path) -> None:
    """SQLite cannot make the file next to the history that readers share, as on a read-only disk."""
    file = tmp_path / "history.sqlite"
    History.open(file, create=True).close()
    (tmp_path / "history.sqlite-shm").symlink_to("history.sqlite-shm")
    with pytest.raises(HistoryError, match=r"the folder must be writable for reading too; make it so, or"):
        History.open(file)


def test_a_full_disk_keeps_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "history.sqlite"
    with History.open(path, create=True) as history:
        history.add(entry(), recording(1), diagnosis(1))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    # Python ignores the signal, and writing beyond the limit fails as on a full disk.
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, limits[1]))
    try:
        with pytest.raises(HistoryError, match=r"free space there.*what was added before is kept"):
            add_many(path, range(2, 20))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    with History.open(path) as history:
        kept = [one.recording for one in history.unit("S1").diagnoses()]
        assert kept == [f"{number}.csv" for number in range(1, len(kept) + 1)]
        following = len(kept) + 1
        assert history.add(entry(hours=10.0 * following), recording(following), diagnosis(following)).added


# Migrations


@pytest.fixture
def oldest(address: str) -> str:
    """Return where a history of the first form is, with two recordings of a unit."""
    database = Database.open(Address.of(address), create=True)
    if database.is_file:
        schema._log_ahead(database)
    with database.writing(ADVISORY_LOCK) as connection:
        upgrade(connection, KNOWN[0])
        _fill_oldest(connection)
    database.close()
    return address


def _fill_oldest(connection: sa.Connection) -> None:
    """Write as the program did that knew only the first form."""
    now, (digest, toml) = "2026-01-01T00:00:00Z", description_of(made_up.THESIS)
    unit = {"id": 1, "serial_number": "S1", "part_number": "thesis", "added_at": now}
    connection.execute(UNITS.insert().values(unit))
    connection.execute(DESCRIPTIONS.insert().values(id=1, hash=digest, toml=toml))
    for number in (1, 2):
        held_one = recording(number)
        connection.execute(FLIGHTS.insert().values(id=number, unit_id=1, hours=10.0 * number))
        about = {"id": number, "flight_id": number, "hash": recording_hash(held_one), "name": held_one.source}
        connection.execute(RECORDINGS.insert().values(samples=200, sample_rate_hz=1e3, added_at=now, **about))
        row = {"id": number, "recording_id": number, "description_id": 1, "added_at": now}
        connection.execute(DIAGNOSES.insert().values(row | columns_of(diagnosis(number))))


def form(address: str) -> str:
    """Return the form of a history as its mark says, after checking its tables."""
    database = Database.open(Address.of(address), create=False)
    with database.reading() as connection:
        tables = set(sa.inspect(connection).get_table_names())
        mark = connection.execute(sa.select(VERSION.c.version_num)).scalar_one() if tables else ""
    database.close()
    seventh = {"withdrawals"}
    sixth = {"prognosis_curves"}
    third = {"events", "prognoses", "watched_files", "watched_rows", "delivered"}
    second = {"removals", "findings"}
    every = {*METADATA.tables, VERSION.name}
    to_sixth = every - seventh
    expected = {
        "": set(),
        "0001": to_sixth - second - third - sixth,
        "0002": to_sixth - third - sixth,
        "0003": to_sixth - sixth,
        "0004": to_sixth - sixth,
        "0005": to_sixth - sixth,
        "0006": to_sixth,
        "0007": every,
    }
    assert tables == expected[mark]
    return str(mark)


def test_an_old_history_is_brought_up_to_date_in_place(oldest: str) -> None:
    assert form(oldest) == KNOWN[0]
    with History.open(oldest) as history:
        assert [one.recording for one in history.unit("S1").diagnoses()] == ["1.csv", "2.csv"]
        assert history.add_removal("S1", Removal(30.0, "failed"))
    assert form(oldest) == NEWEST


# The statements of an old history's steps are among those of a new one's: every second of them is enough.
# On a server, where all that happens until the end is one transaction, half of them are.
@pytest.mark.parametrize(("age", "each"), [("oldest", 2), ("new", 1)])
def test_a_migration_killed_at_any_statement_changes_nothing(
    home: Nursery, request: pytest.FixtureRequest, address: str, age: str, each: int, tmp_path: Path
) -> None:
    before = ""
    if age == "oldest":
        before = form(request.getfixturevalue("oldest"))
    else:
        Database.open(Address.of(address), create=True).close()
    forms = []
    if address.startswith("postgresql"):
        each *= 2
    for statement in range(1, MOST_STATEMENTS, each):
        job = Job(address, str(tmp_path / "acknowledged"), [], die_at=statement)
        ended = home.wait(home.start(job))
        if ended == 0:
            break
        assert ended == signal.SIGKILL
        forms.append(form(address))
    assert forms == [before] * len(forms)
    assert len(forms) > 5
    assert form(address) == NEWEST
    with History.open(address) as history:
        assert len(history.units()) == (age == "oldest")


def test_the_tables_are_those_that_the_migrations_make(history: History) -> None:
    with history.database.reading() as connection:
        inspector = sa.inspect(connection)
        for name, table in METADATA.tables.items():
            made = {column["name"]: column for column in inspector.get_columns(name)}
            assert list(made) == list(table.columns.keys())
            for column in table.columns:
                assert made[column.name]["nullable"] == column.nullable
            unique = {tuple(one["column_names"]) for one in inspector.get_unique_constraints(name)}
            stated = {
                tuple(column.name for column in constraint.columns)
                for constraint in table.constraints
                if isinstance(constraint, sa.UniqueConstraint)
            }
            assert unique == stated


def test_this_version_knows_all_steps() -> None:
    from alembic.script import ScriptDirectory

    steps = ScriptDirectory(str(Path(schema.__file__).parent / "migrations"))
    assert tuple(step.revision for step in reversed([*steps.walk_revisions()])) == KNOWN
    assert steps.get_current_head() == NEWEST
