"""Killed and concurrent writers, full disks and interrupted migrations lose no acknowledged recording."""

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
from emaphm.history.fingerprint import description_of
from emaphm.history.storage import schema
from emaphm.history.storage.address import Address
from emaphm.history.storage.database import Database
from emaphm.history.storage.diagnosis_row import row_of
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
"""More statements than the migration of an old history has."""

PATIENCE_S = 60


@pytest.fixture(scope="module")
def home() -> Iterator[Nursery]:
    """Return a process that forks writers."""
    with nursery() as started:
        yield started


def test_killed_writers_lose_no_acknowledged_recording(home: Nursery, address: str, tmp_path: Path) -> None:
    assert kill_writers(home, address, tmp_path, KILLS) > 0


def test_a_writer_killed_within_a_transaction_leaves_no_partial_recording(
    home: Nursery, address: str, tmp_path: Path
) -> None:
    notes = tmp_path / "acknowledged"
    child = home.start(Job(address, str(notes), [0, 1, 2], pause_at=1))
    deadline = time.monotonic() + PATIENCE_S
    while not notes.exists() or "half" not in notes.read_text():
        assert time.monotonic() < deadline
        time.sleep(0.005)
    # A reader neither waits for the writer nor reads its uncommitted rows.
    assert held(address) == [0]
    os.kill(child, signal.SIGKILL)
    assert home.wait(child) == signal.SIGKILL
    assert acknowledged(notes) == [0]
    assert held(address) == [0]
    with History.open(address) as history:
        assert [unit.serial_number for unit in history.units()] == ["S0"]
    assert home.wait(home.start(Job(address, str(notes), [0, 1, 2]))) == 0
    assert held(address) == [0, 1, 2]


def test_eight_concurrent_writers_lose_no_recording(home: Nursery, address: str, tmp_path: Path) -> None:
    write_at_once(home, address, tmp_path, each=3)


def test_no_auxiliary_files_remain_after_closing(tmp_path: Path) -> None:
    with History.open(tmp_path / "history.sqlite", create=True) as history:
        history.add(entry(), recording(1), diagnosis(1))
    assert [path.name for path in tmp_path.iterdir()] == ["history.sqlite"]


def add_many(path: Path, numbers: range) -> None:
    with History.open(path) as history:
        for number in numbers:
            history.add(entry(hours=10.0 * number), recording(number), diagnosis(number))


def test_opening_in_a_read_only_folder_is_refused_with_a_remedy(tmp_path: Path) -> None:
    """As on a read-only disk, SQLite cannot create the shared-memory file next to the history."""
    file = tmp_path / "history.sqlite"
    History.open(file, create=True).close()
    (tmp_path / "history.sqlite-shm").symlink_to("history.sqlite-shm")
    with pytest.raises(HistoryError, match=r"the folder must be writable for reading too; make it so, or"):
        History.open(file)


def test_a_full_disk_does_not_damage_stored_recordings(tmp_path: Path) -> None:
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
        kept = [kept_diagnosis.recording for kept_diagnosis in history.unit("S1").diagnoses()]
        assert kept == [f"{number}.csv" for number in range(1, len(kept) + 1)]
        following = len(kept) + 1
        assert history.add(entry(hours=10.0 * following), recording(following), diagnosis(following)).added


# Migrations


@pytest.fixture
def oldest(address: str) -> str:
    """Return the address of a history of the first form with two recordings of a unit."""
    database = Database.open(Address.of(address), create=True)
    if database.is_file:
        schema._log_ahead(database)
    with database.writing(ADVISORY_LOCK) as connection:
        upgrade(connection, KNOWN[0])
        _fill_oldest(connection)
    database.close()
    return address


def _fill_oldest(connection: sa.Connection) -> None:
    """Write rows as the first version of the program did."""
    now, (digest, toml) = "2026-01-01T00:00:00Z", description_of(made_up.THESIS)
    unit = {"id": 1, "serial_number": "S1", "part_number": "thesis", "added_at": now}
    connection.execute(UNITS.insert().values(unit))
    connection.execute(DESCRIPTIONS.insert().values(id=1, hash=digest, toml=toml))
    for number in (1, 2):
        held_recording = recording(number)
        connection.execute(FLIGHTS.insert().values(id=number, unit_id=1, hours=10.0 * number))
        about = {
            "id": number,
            "flight_id": number,
            "hash": recording_hash(held_recording),
            "name": held_recording.source,
        }
        connection.execute(RECORDINGS.insert().values(samples=200, sample_rate_hz=1e3, added_at=now, **about))
        row = {"id": number, "recording_id": number, "description_id": 1, "added_at": now}
        connection.execute(DIAGNOSES.insert().values(row | row_of(diagnosis(number))))


def form(address: str) -> str:
    """Return the form of a history from its version mark, after checking that its tables match."""
    database = Database.open(Address.of(address), create=False)
    with database.reading() as connection:
        tables = set(sa.inspect(connection).get_table_names())
        mark = connection.execute(sa.select(VERSION.c.version_num)).scalar_one() if tables else ""
    database.close()
    added_by_0007 = {"withdrawals"}
    added_by_0006 = {"prognosis_curves"}
    added_by_0003 = {"events", "prognoses", "watched_files", "watched_rows", "delivered"}
    added_by_0002 = {"removals", "findings"}
    all_tables = {*METADATA.tables, VERSION.name}
    up_to_0006 = all_tables - added_by_0007
    expected = {
        "": set(),
        "0001": up_to_0006 - added_by_0002 - added_by_0003 - added_by_0006,
        "0002": up_to_0006 - added_by_0003 - added_by_0006,
        "0003": up_to_0006 - added_by_0006,
        "0004": up_to_0006 - added_by_0006,
        "0005": up_to_0006 - added_by_0006,
        "0006": up_to_0006,
        "0007": all_tables,
    }
    assert tables == expected[mark]
    return str(mark)


def test_an_old_history_is_migrated_in_place(oldest: str) -> None:
    assert form(oldest) == KNOWN[0]
    with History.open(oldest) as history:
        assert [kept_diagnosis.recording for kept_diagnosis in history.unit("S1").diagnoses()] == [
            "1.csv",
            "2.csv",
        ]
        assert history.add_removal("S1", Removal(30.0, "failed"))
    assert form(oldest) == NEWEST


# A new history executes the statements of an old history's migration too, so every second is enough for the
# old one. On a server, where everything is one transaction, half of the statements are enough.
@pytest.mark.parametrize(("age", "each"), [("oldest", 2), ("new", 1)])
def test_a_migration_killed_at_any_statement_leaves_the_old_form(
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


def test_migrations_create_the_declared_tables(history: History) -> None:
    with history.database.reading() as connection:
        inspector = sa.inspect(connection)
        for name, table in METADATA.tables.items():
            columns = {column["name"]: column for column in inspector.get_columns(name)}
            assert list(columns) == list(table.columns.keys())
            for column in table.columns:
                assert columns[column.name]["nullable"] == column.nullable
            unique = {
                tuple(constraint["column_names"]) for constraint in inspector.get_unique_constraints(name)
            }
            expected = {
                tuple(column.name for column in constraint.columns)
                for constraint in table.constraints
                if isinstance(constraint, sa.UniqueConstraint)
            }
            assert unique == expected


def test_the_list_of_known_migrations_is_complete() -> None:
    from alembic.script import ScriptDirectory

    steps = ScriptDirectory(str(Path(schema.__file__).parent / "migrations"))
    assert tuple(step.revision for step in reversed([*steps.walk_revisions()])) == KNOWN
    assert steps.get_current_head() == NEWEST
