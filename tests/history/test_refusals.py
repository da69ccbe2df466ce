"""Contradictions to a history are refused with a one-line message that gives a remedy; nothing is changed."""

import re
import socket
import sqlite3
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
import sqlalchemy as sa

from emaphm.errors import HistoryError, HistoryUnavailableError
from emaphm.history import Entry, Finding, History, Mistake, Removal
from emaphm.history.blocks import unit_blocks
from emaphm.history.records import whole_cycles
from emaphm.history.storage import database
from emaphm.history.storage.address import Address
from emaphm.history.storage.database import Database
from emaphm.history.storage.schema import VERSION
from emaphm.history.storage.tables import UNITS

from . import made_up
from .conftest import server
from .made_up import diagnosis, entry, recording

LONGEST_S = 10.0
"""Time limit for the message that there is no database."""


@pytest.fixture
def flown(history: History) -> History:
    """Return a history with recordings 1, 2 and 3 of a unit at 10, 20 and 30 h."""
    for number in (1, 2, 3):
        flight = Entry("SN-0042", made_up.PART, 10.0 * number, 5 * number, load=0.5)
        history.add(flight, recording(number), diagnosis(number))
    return history


def refusal(call: Callable[[], object]) -> str:
    """Return the message with which `call` is refused."""
    with pytest.raises(HistoryError) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    assert "Traceback" not in message
    return message


CONTRADICTIONS = {
    "hours going backwards": (
        Entry("SN-0042", made_up.PART, 25.0),
        7,
        "30 h already, from a recording .*, 25 h .* --late",
    ),
    "the recording of another unit": (Entry("SN-0043", made_up.PART, 50.0), 2, "'2.csv' of unit 'SN-0042'"),
    "the recording at other hours": (
        Entry("SN-0042", made_up.PART, 40.0),
        3,
        "at 30 h; it cannot be of 40 h",
    ),
    "the recording at other cycles": (Entry("SN-0042", made_up.PART, 30.0, 99), 3, "at 15 cycles"),
    "another part number": (Entry("SN-0042", "P/N 7", 40.0), 7, "part number 'thesis', .* 'P/N 7'.*--part"),
    "fewer cycles later": (Entry("SN-0042", made_up.PART, 40.0, 14), 7, "15 cycles at 30 h, so 14 at 40 h"),
    "two counts at once": (Entry("SN-0042", made_up.PART, 30.0, 16), 7, "15 cycles at 30 h, so 16 at 30 h"),
    "another load of a flight": (
        Entry("SN-0042", made_up.PART, 30.0, load=2.0),
        7,
        "load 0.5 at 30 h already",
    ),
    "more cycles earlier": (
        Entry("SN-0042", made_up.PART, 15.0, 12, late=True),
        7,
        "10 cycles at 20 h, so 12 at 15 h",
    ),
}


def test_hours_before_those_of_a_finding_are_refused(flown: History) -> None:
    flown.add_finding("SN-0042", Finding(4e4, "friction", "degraded", replaced=True))
    message = refusal(lambda: flown.add(Entry("SN-0042", made_up.PART, 40.0), recording(7), diagnosis(7)))
    assert "40000 h already, from a finding on friction" in message
    flown.withdraw("SN-0042", Mistake("finding", 4e4, "400 was meant"))
    assert flown.add(Entry("SN-0042", made_up.PART, 40.0), recording(7), diagnosis(7)).added


def test_a_contradiction_is_refused_before_and_after_the_diagnosis(flown: History) -> None:
    before = unit_blocks(flown.unit("SN-0042"))
    for name, (contradicting, number, words) in CONTRADICTIONS.items():
        with pytest.raises(HistoryError, match=words):
            flown.missing(contradicting, recording(number), made_up.THESIS)
        add = partial(flown.add, contradicting, recording(number), diagnosis(number))
        assert "check --" in refusal(add), name
        assert unit_blocks(flown.unit("SN-0042")) == before, name
        assert len(flown.units()) == 1, name


def test_a_value_refused_by_the_database_is_not_reported_as_an_unreachable_database(history: History) -> None:
    """A caller would repeat the write endlessly if the database were reported as unreachable."""
    unit = {"serial_number": "S1", "part_number": "P", "added_at": "2026-01-01T00:00:00Z"}

    def twice() -> None:
        with history.database.writing() as connection:
            for _ in range(2):
                connection.execute(UNITS.insert().values(unit))

    assert "the database refuses a value" in refusal(twice)
    if not history.database.is_file:  # SQLite stores NUL
        assert "NUL" in refusal(lambda: history.unit("S\0"))
    for call in (twice, lambda: history.unit("S\0")):
        with pytest.raises(HistoryError) as caught:
            call()
        assert not isinstance(caught.value, HistoryUnavailableError)
    assert not history.units()


def test_an_old_recording_may_be_added_late(flown: History) -> None:
    late = Entry("SN-0042", made_up.PART, 15.0, 6, late=True)
    assert flown.add(late, recording(7), diagnosis(7)).added
    assert [kept.hours for kept in flown.unit("SN-0042").diagnoses()] == [10, 15, 20, 30]
    # A recording that is already stored does not need `late`.
    assert not flown.add(entry("SN-0042", 10.0), recording(1), diagnosis(1)).added


def test_cycles_added_later_must_be_consistent(history: History) -> None:
    history.add(entry(hours=10.0), recording(1), diagnosis(1))
    history.add(Entry("S1", made_up.PART, 20.0, 5), recording(2), diagnosis(2))
    with pytest.raises(HistoryError, match="5 cycles at 20 h, so 9 at 10 h"):
        history.add(Entry("S1", made_up.PART, 10.0, 9), recording(1), diagnosis(1, seed=1))


def test_hours_before_those_of_a_removal_are_refused(flown: History) -> None:
    flown.add_removal("SN-0042", Removal(50.0, "scheduled"))
    with pytest.raises(HistoryError, match="50 h already"):
        flown.add(entry("SN-0042", 40.0), recording(7), diagnosis(7))


def test_an_unknown_unit_is_refused_with_the_nearest_name(flown: History) -> None:
    for call in (
        lambda: flown.unit("sn-0024"),
        lambda: flown.add_removal("sn-0024", Removal(1.0, "other")),
        lambda: flown.add_finding("sn-0024", Finding(1.0, "gain", "healthy")),
    ):
        assert refusal(call) == "no unit 'sn-0024' in the history (did you mean 'SN-0042'?)"


def test_the_message_on_an_unknown_unit_states_that_the_history_is_empty(history: History) -> None:
    assert refusal(lambda: history.unit("S1")) == "no unit 'S1' in the history; the history is empty"


def test_a_different_removal_or_finding_at_the_same_hours_is_refused(flown: History) -> None:
    flown.add_removal("SN-0042", Removal(30.0, "failed"))
    flown.add_finding("SN-0042", Finding(30.0, "gain", "failed", 0.9))
    with pytest.raises(HistoryError, match="a removal is in the history already, with reason 'failed'"):
        flown.add_removal("SN-0042", Removal(30.0, "scheduled"))
    with pytest.raises(HistoryError, match=r"a finding on gain is .* with level 0\.9; nothing was changed"):
        flown.add_finding("SN-0042", Finding(30.0, "gain", "failed", 0.8))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Entry("", "P", 1.0), "unit '' is no name"),
        (lambda: Entry("a\nb", "P", 1.0), "printable"),
        (lambda: Entry("\udc80", "P", 1.0), "printable"),
        (lambda: Entry("S" * 201, "P", 1.0), "200 at most"),
        (lambda: Entry("S", " ", 1.0), "part number"),
        (lambda: Entry("S", "P", -1.0), "hours -1"),
        (lambda: Entry("S", "P", float("nan")), "hours nan"),
        (lambda: Entry("S", "P", float("inf")), "hours inf"),
        (lambda: Entry("S", "P", 1.0, -1), "cycles -1"),
        (lambda: Entry("S", "P", 1.0, 2**40), "cycles"),
        (lambda: whole_cycles("12.6"), "cycles are no whole number from 0 to"),
        (lambda: whole_cycles("2147483648"), "no whole number from 0 to 2,147,483,647; correct them"),
        (lambda: Entry("S", "P", 1.0, position=""), "position"),
        (lambda: Removal(1.0, "fialed"), "did you mean 'failed'"),
        (lambda: Removal(1.0, "other", "\0"), "note"),
        (lambda: Finding(1.0, "backlas", "failed"), "did you mean 'backlash'"),
        (lambda: Finding(1.0, "bearings", "failed"), "known: backlash, .*on .unit., with a note"),
        (lambda: Finding(1.0, "gain", "broken"), "unknown condition 'broken'"),
        (lambda: Finding(1.0, "gain", "failed", 1.5), r"level 1\.5 lies outside"),
        (lambda: Finding(1.0, "backlash", "failed", -0.2), r"level -0\.2 lies outside \[0, 1\]"),
        (lambda: Finding(1.0, "friction", "failed", -1.2), r"level -1\.2 lies outside \[-1, 1\]"),
        (lambda: Finding(1.0, "unit", "failed", 0.5), "name the component"),
    ],
)
def test_invalid_entries_removals_and_findings_are_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(HistoryError, match=words):
        make()


# What is opened


def test_a_history_of_a_newer_version_is_refused_with_a_remedy(address: str) -> None:
    with History.open(address, create=True) as older:
        with older.database.writing() as connection:
            connection.execute(VERSION.update().values(version_num="0099"))
        # A history that was open while a newer version migrated it refuses to write.
        assert "update emaphm" in refusal(lambda: older.add(entry(), recording(1), diagnosis(1)))
    message = refusal(lambda: History.open(address))
    assert "form 0099" in message
    assert "update emaphm" in message


def test_a_missing_history_is_not_created_for_reading(address: str) -> None:
    with pytest.raises(HistoryError, match=r"no such history|holds no history"):
        History.open(address)


def tables_of(address: str, *statements: str) -> list[str]:
    """Return the names of a database's tables and views, after executing the `statements`."""
    url = (
        address.replace("postgresql:", "postgresql+psycopg:") if "://" in address else f"sqlite:///{address}"
    )
    engine = sa.create_engine(url)
    with engine.begin() as connection:
        for statement in statements:
            connection.exec_driver_sql(statement)
        inspector = sa.inspect(connection)
        names = sorted([*inspector.get_table_names(), *inspector.get_view_names()])
    engine.dispose()
    return names


@pytest.mark.parametrize("made", ["TABLE units (a integer)", "VIEW units AS SELECT 1 AS a"])
def test_a_database_with_conflicting_foreign_tables_is_refused_and_unchanged(address: str, made: str) -> None:
    before = tables_of(address, f"CREATE {made}")
    with pytest.raises(HistoryError, match="is no history, it has a table 'units'; give a history, or a"):
        History.open(address, create=True)
    assert tables_of(address) == before == ["units"]


def test_other_tables_are_refused_in_a_file_and_accepted_on_a_server(address: str) -> None:
    before = tables_of(address, "CREATE TABLE foo (a integer)", "CREATE TABLE alembic_version (a integer)")
    if "://" not in address:
        with pytest.raises(HistoryError, match="it has a table 'alembic_version'; give a history, or a new"):
            History.open(address, create=True)
        assert tables_of(address) == before
        return
    with History.open(address, create=True) as opened:
        assert opened.units() == ()
    assert set(before) < set(tables_of(address))


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("absent/history.sqlite", "there is no folder 'absent'"),
        (".", "is no file"),
        ("text.csv", "not a database"),
        ("mysql://user:secret@host/name", "'mysql://' is no database"),
        ("postgresql://user:secret@host:port/name", "URL cannot be read"),
        ("postgresql://user:very@secret@host/name", "as %40"),
        ("postgresql://user@127.0.0.1:1/name?password=secret", "127.0.0.1:1/name: the database"),
        ("postgresql://user@127.0.0.1:1/name?sslmode=none", "invalid sslmode"),
        ("sqlite://", "names no file"),
        ("nul\0", "null character"),
    ],
)
def test_invalid_addresses_are_refused_without_showing_the_password(
    where: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("text.csv").write_text("time_s,current_A\n" * 1000, encoding="utf-8")
    message = refusal(lambda: History.open(where, create=True))
    assert words in message
    assert "secret" not in message


def test_a_damaged_file_is_reported_as_malformed(tmp_path: Path) -> None:
    path = tmp_path / "history.sqlite"
    with History.open(path, create=True) as undamaged:
        undamaged.add(entry(), recording(1), diagnosis(1))
    content = bytearray(path.read_bytes())
    content[4096:] = bytes(len(content) - 4096)
    path.write_bytes(content)
    assert "malformed" in refusal(lambda: History.open(path).unit("S1"))


# Databases that cannot be reached


@pytest.fixture
def silent() -> Iterator[int]:
    """Return a port with a listening socket that never answers."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        yield listening.getsockname()[1]


def test_a_port_without_a_server_is_reported_in_time() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = listening.getsockname()[1]
    began = time.monotonic()
    message = refusal(lambda: History.open(f"postgresql://me:secret@127.0.0.1:{port}/fleet"))
    assert time.monotonic() - began < LONGEST_S
    assert f"postgresql://me:***@127.0.0.1:{port}/fleet" in message
    assert "check the address" in message


def test_a_server_that_never_answers_is_reported_in_time(
    silent: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = database.SETTINGS
    assert usual.host_s < usual.answer_s < LONGEST_S
    monkeypatch.setattr(database, "SETTINGS", replace(usual, host_s=2))  # the shortest time-out of libpq
    began = time.monotonic()
    message = refusal(lambda: History.open(f"postgresql://me:secret@127.0.0.1:{silent}/fleet"))
    assert time.monotonic() - began < LONGEST_S
    assert f"127.0.0.1:{silent}/fleet" in message
    assert "secret" not in message


def test_opening_a_silent_database_ends_after_the_time_limit(
    silent: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database, "SETTINGS", replace(database.SETTINGS, answer_s=0.1))
    address = Address.of(f"postgresql://me@127.0.0.1:{silent}/fleet")
    assert "no answer within 0.1 s; check the address" in refusal(
        lambda: Database.open(address, create=False)
    )


def test_a_wrong_password_is_not_shown_in_the_message() -> None:
    url = sa.make_url(server()).set(password="not this one")  # noqa: S106
    message = refusal(lambda: History.open(url.render_as_string(hide_password=False)))
    assert "check the user and the password" in message
    assert "not this one" not in message


def test_a_database_that_does_not_exist_is_refused_with_a_remedy() -> None:
    url = sa.make_url(server()).set(database="no_such")
    assert "create it" in refusal(lambda: History.open(url.render_as_string(hide_password=False)))


def test_a_file_locked_by_another_program_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(database, "SETTINGS", replace(database.SETTINGS, file_s=0.2))
    path = tmp_path / "history.sqlite"
    History.open(path, create=True).close()
    holder = sqlite3.connect(path, isolation_level=None)
    holder.execute("PRAGMA locking_mode = EXCLUSIVE")
    holder.execute("BEGIN EXCLUSIVE")
    try:
        assert "another program holds it" in refusal(lambda: History.open(path))
    finally:
        holder.close()


def test_a_connection_ended_by_the_server_is_opened_again(flown: History) -> None:
    if flown.database.is_file:
        pytest.skip("a file has no server")
    with flown.database.reading() as connection:
        ours = connection.exec_driver_sql("SELECT pg_backend_pid()").scalar_one()
    other = sa.create_engine(sa.make_url(server()).set(drivername="postgresql+psycopg"))
    with other.begin() as connection:
        connection.execute(sa.text("SELECT pg_terminate_backend(:pid)"), {"pid": ours})
    other.dispose()
    time.sleep(0.1)
    assert len(flown.unit("SN-0042").diagnoses()) == 3


def test_invalid_withdrawals_are_refused(flown: History) -> None:
    flown.add(Entry("SN-0042", made_up.PART, 30.0), recording(4), diagnosis(4))
    flown.add_removal("SN-0042", Removal(30.0, "suspected"))
    flown.add(Entry("SN-0001", made_up.PART, 5.0), recording(9), diagnosis(9))
    flown.add_finding("SN-0001", Finding(5.0, "friction", "healthy"))
    before = {name: unit_blocks(flown.unit(name)) for name in ("SN-0042", "SN-0001")}
    for unit, mistake, words in (
        ("SN-42", ("recording", 10.0, "typo"), "did you mean 'SN-0042'"),
        ("SN-0042", ("recording", 12.0, "typo"), "no recording there; the nearest are at 10 h, 20 h, 30 h"),
        ("SN-0042", ("finding", 10.0, "typo"), "no finding there, nor at other hours"),
        (
            "SN-0042",
            ("recording", 30.0, "typo"),
            "there are '3.csv' (.*), '4.csv' (.*); name the entry with --which",
        ),
        ("SN-0042", ("recording", 30.0, "typo", "5.csv"), "no recording '5.csv' there, but '3.csv'"),
        ("SN-0001", ("recording", 5.0, "typo"), "the only recording of unit 'SN-0001', which has findings"),
    ):
        message = refusal(partial(flown.withdraw, unit, Mistake(*mistake)))
        assert re.search(words.replace("(.*)", r"\(.{8}\)"), message), message
    assert {name: unit_blocks(flown.unit(name)) for name in before} == before
    assert "did you mean 'removal'" in refusal(partial(Mistake, "removl", 1.0, "typo"))
    assert "needs a reason; give one" in refusal(partial(Mistake, "removal", 1.0, " "))


def test_messages_give_hours_with_all_digits(flown: History) -> None:
    old = Entry("SN-0042", made_up.PART, 123456.75)
    flown.add(old, recording(8), diagnosis(8))
    message = refusal(lambda: flown.add(replace(old, hours=123456.5), recording(9), diagnosis(9)))
    assert "123456.75 h already" in message
    assert "123456.5 h would be going backwards" in message
