"""Watching a folder and a stream: each recording once, whatever happens in between."""

import json
import os
import resource
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sqlalchemy as sa

import waiting
from emaphm.errors import HistoryFormError, HistoryUnavailableError, MonitoringError, RecordingError
from emaphm.history import Event, History
from emaphm.history.storage.database import Database
from emaphm.history.storage.schema import VERSION
from emaphm.history.storage.tables import DIAGNOSES
from emaphm.monitoring import NamePattern, Ownership, Watching, WatchSettings, WatchTask, watch
from emaphm.monitoring.folder import FolderSource
from emaphm.monitoring.receivers import Webhook
from emaphm.monitoring.settings import PressureSettings
from emaphm.monitoring.stream.source import StreamSource
from emaphm.monitoring.watch_state import WatchState
from emaphm.recording import Recording, read_recordings

from . import stand_in
from .hooks import webhook
from .stand_in import PATTERN, QUICK, THESIS

pytestmark = pytest.mark.usefixtures("no_prognoses")

PATIENCE_S = 20.0
wait_for = partial(waiting.wait_for, patience_s=PATIENCE_S)
FAST = replace(
    QUICK,
    folder=replace(QUICK.folder, poll_s=0.05, settle_s=0.15),
    delivery=replace(QUICK.delivery, last_s=3.0),
    retry_s=0.2,
)
WRITTEN = replace(
    FAST,
    folder=replace(FAST.folder, poll_s=0.05, settle_s=0.0),
    delivery=replace(FAST.delivery, first_pause_s=0.01, longest_pause_s=0.1),
    retry_s=0.02,
)
"""Where all files are whole before the watching begins."""


def put(folder: Path, *numbers: int, unit: int = 1) -> None:
    for number in numbers:
        (folder / stand_in.name(unit, number)).write_text(stand_in.content(unit, number))


def task(source: Path | int, **options: Any) -> WatchTask:
    usual: dict[str, Any] = {
        "ownership": Ownership(THESIS.name, pattern=PATTERN),
        "name": "test",
        "cut": None,
        "diagnose": stand_in.diagnosed,
        "takes_new_units": True,
        "once": True,
    }
    return WatchTask(source, **usual | options)


@pytest.fixture
def inbox(tmp_path: Path) -> Path:
    folder = tmp_path / "in"
    folder.mkdir()
    return folder


def judged(history: History) -> list[tuple[str, float]]:
    return [(unit.serial_number, one.hours) for unit in history.units() for one in unit.diagnoses()]


def count(history: History) -> int:
    """Return how many diagnoses there are, which is quicker than to read them."""
    with history.database.reading() as connection:
        return connection.execute(sa.select(sa.func.count()).select_from(DIAGNOSES)).scalar_one()


@contextmanager
def running(
    task: WatchTask, history: History, said: list[str] | None = None, settings: WatchSettings = FAST
) -> Iterator[None]:
    """Watch in a thread while the body runs."""
    stop, failures, heard = threading.Event(), list[BaseException](), said if said is not None else []

    def run() -> None:
        try:
            watch(task, history, THESIS, settings=settings, stop=stop, say=heard.append)
        except BaseException as error:  # noqa: BLE001 - raised below
            failures.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(PATIENCE_S)
    assert not failures, failures


def once(folder: Path, history: History, said: list[str] | None = None, **options: Any) -> Watching:
    heard = said if said is not None else []
    return watch(task(folder, **options), history, THESIS, settings=WRITTEN, say=heard.append)


def test_files_are_judged_once(inbox: Path, history: History) -> None:
    put(inbox, 0, 1)
    put(inbox, 0, unit=2)
    assert once(inbox, history).judged == 3
    assert judged(history) == [("U01", 0.0), ("U01", 0.24), ("U02", 0.0)]
    put(inbox, 2)
    again = once(inbox, history)
    assert (again.judged, again.known) == (1, 0)
    (inbox / stand_in.name(1, 0)).touch()  # another time, the same content
    assert (once(inbox, history).judged, len(history.events(kinds=["refused"]))) == (0, 0)


def test_each_piece_of_a_file_is_its_own_unit_s(inbox: Path, history: History) -> None:
    pieces = []
    for i, (unit, hours) in enumerate((("20240000000017", 10), ("20240000000018", 20))):
        header, *rows = stand_in.content(1, i).splitlines()
        pieces += [f"{row},{unit},{hours}" for row in rows]
    (inbox / "day.csv").write_text("\n".join([f"{header},unit,hours", *pieces]) + "\n")
    assert once(inbox, history, ownership=Ownership(THESIS.name), split="unit").judged == 2
    assert judged(history) == [("20240000000017", 10.0), ("20240000000018", 20.0)]
    (inbox / "long.csv").write_text(
        "\n".join([f"{header},unit,hours", *(f"{row},123456789012345678901,5" for row in rows)]) + "\n"
    )
    assert once(inbox, history, ownership=Ownership(THESIS.name)).refused == 1
    assert "more digits than a number keeps" in history.events(kinds=["refused"])[-1].message


@pytest.mark.parametrize("unit", ["3.10", "3.1", "1e-2"])
def test_a_unit_that_is_a_number_with_decimals_is_refused(unit: str, inbox: Path, history: History) -> None:
    (inbox / "day.csv").write_text(of_units(unit))
    assert once(inbox, history, ownership=Ownership(THESIS.name)).refused == 1
    said = history.events(kinds=["refused"])[-1].message
    assert "with decimals" in said
    assert "write it with a letter" in said


def test_decimals_are_for_hours_and_for_serial_numbers_that_are_text() -> None:
    entry = Ownership(THESIS.name).entry("day.csv", {"unit": "3.10", "hours": 812.5})
    assert (entry.unit, entry.hours) == ("3.10", 812.5)
    assert Ownership(THESIS.name).entry("day.csv", {"unit": 17.0, "hours": 812.5}).unit == "17"


@pytest.mark.parametrize("cycles", [12.6, -1.0, "many", 1e12])
def test_cycles_that_are_no_whole_number_are_refused(cycles: float | str) -> None:
    with pytest.raises(RecordingError, match=r"day\.csv: its cycles are no whole number from 0 to"):
        Ownership(THESIS.name, "S1", 812.5).entry("day.csv", {"cycles": cycles})
    assert Ownership(THESIS.name, "S1", 812.5).entry("day.csv", {"cycles": 13.0}).cycles == 13


def of_units(*units: str) -> str:
    """Return the CSV of a file with a recording of each unit."""
    header = stand_in.content(1, 0).splitlines()[0]
    rows = [
        f"{row},{unit},{number}"
        for number, unit in enumerate(units)
        for row in stand_in.content(1, number).splitlines()[1:]
    ]
    return "\n".join([f"{header},unit,hours", *rows]) + "\n"


def test_a_refused_piece_of_a_file_is_tried_again_at_the_next_start(inbox: Path, history: History) -> None:
    stand_in.fly(history, [0.1])
    (inbox / "day.csv").write_text(of_units("S1", "S2"))

    def found(**options: Any) -> tuple[int, int, int]:
        done = once(inbox, history, ownership=Ownership(THESIS.name), split="unit", **options)
        return done.judged, done.known, done.refused

    assert found(takes_new_units=False) == (1, 0, 1)
    assert found(takes_new_units=False) == (0, 1, 1)
    assert len(history.events(kinds=["refused"])) == 1
    assert found() == (1, 1, 0)
    assert found() == (0, 0, 0)
    assert judged(history) == [("S1", 0.0), ("S1", 0.0), ("S2", 1.0)]


def test_a_file_that_was_judged_in_part_is_not_judged_again_when_it_changes(
    inbox: Path, history: History
) -> None:
    stand_in.fly(history, [0.1])
    for units in (("S1", "S2"), ("S1", "S2", "S1")):
        (inbox / "day.csv").write_text(of_units(*units))
        done = once(inbox, history, ownership=Ownership(THESIS.name), split="unit", takes_new_units=False)
        assert done.refused == 1
    assert "was changed after it was judged" in history.events(kinds=["refused"])[-1].message
    assert len(judged(history)) == 2


def test_events_are_lines_once(inbox: Path, history: History, tmp_path: Path) -> None:
    put(inbox, *range(19, 25))
    with (tmp_path / "lines").open("wb") as lines:
        once(inbox, history, lines=lines.fileno())
        once(inbox, history, lines=lines.fileno())
    values = [json.loads(line) for line in (tmp_path / "lines").read_text().splitlines()]
    assert values == [one.to_dict() for one in history.events()]
    assert [(one["event"], one["state"]) for one in values] == [
        ("health_changed", "raised"),
        ("alarm", "raised"),
    ]


def test_a_watcher_that_was_stopped_goes_on(inbox: Path, history: History) -> None:
    """Between any two steps: the history fails once after each number of transactions."""
    put(inbox, *range(22, 26))
    counts = iter(range(1, 200))
    failed = True
    while failed:
        failed = False
        left = [next(counts)]

        def interrupted(self: Database, *_: Any, left: list[int] = left, real: Any = Database.writing) -> Any:
            left[0] -= 1
            if left[0] == 0:
                raise KeyboardInterrupt
            return real(self)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Database, "writing", interrupted)
            try:
                once(inbox, history)
            except KeyboardInterrupt:
                failed = True
    assert judged(history) == [("U01", round(i * stand_in.FLIGHT_H, 2)) for i in range(22, 26)]
    kinds = [(one.kind, one.state) for one in history.events()]
    assert kinds == [("health_changed", "raised"), ("alarm", "raised"), ("health_changed", "raised")]


def test_a_half_written_file_is_waited_for(
    inbox: Path, history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a clock that goes on between two looks alone, whatever else the machine does."""
    text = stand_in.content(1, 0)
    clock, looks, look = [0.0], [0], FolderSource._poll

    def counted(self: FolderSource) -> None:
        look(self)
        looks[0] += 1

    def looked_after(seconds: float) -> None:
        before = looks[0]
        clock[0] += seconds
        wait_for(lambda: looks[0] > before)

    monkeypatch.setattr(FolderSource, "_poll", counted)
    monkeypatch.setattr("emaphm.monitoring.folder.time", SimpleNamespace(monotonic=lambda: clock[0]))
    settings = replace(FAST, folder=replace(FAST.folder, settle_s=1.5))
    with running(task(inbox, once=False), history, settings=settings):
        with (inbox / stand_in.name(1, 0)).open("w") as file:
            for i in range(0, len(text), len(text) // 8):
                file.write(text[i : i + len(text) // 8])
                file.flush()
                looked_after(1.0)
                assert not judged(history)
        looked_after(1.0)
        assert not judged(history)
        looked_after(1.0)
        wait_for(lambda: judged(history))
    (kept,) = history.unit("U01").diagnoses()
    assert json.loads(kept.text)["recording"] == str(inbox / stand_in.name(1, 0))
    assert not history.events(kinds=["refused"])


def test_a_file_that_changes_afterwards_is_not_judged_again(inbox: Path, history: History) -> None:
    put(inbox, 0)
    once(inbox, history)
    path = inbox / stand_in.name(1, 0)
    path.write_text(path.read_text() + "0.0600,0.001,1.0\n")
    for _ in range(2):
        once(inbox, history)
    assert len(judged(history)) == 1
    (refused,) = history.events(kinds=["refused"])
    assert "was changed after it was judged" in refused.message


def test_what_cannot_be_used_is_refused_once_and_tried_again_at_the_next_start(
    inbox: Path, history: History
) -> None:
    put(inbox, 0)
    (inbox / "U01_5.csv").write_text("no recording")
    (inbox / "nameless.csv").write_text(stand_in.content(1, 3))
    (inbox / "U03_7.csv").write_text(stand_in.content(1, 0))  # the same rows of another unit
    (inbox / "U04_1.csv").mkdir()
    (inbox / ".hidden.csv").write_text("no recording")
    (inbox / "note.txt").write_text("no recording")
    said = list[str]()
    for _ in range(2):
        assert once(inbox, history, said).refused == 3
    assert len([line for line in said if "refused as before" in line]) == 3  # their events are there already
    refused = {one.subject: one.message for one in history.events()}
    assert set(refused) == {"U01_5.csv", "nameless.csv", "U03_7.csv"}
    assert "its unit is not known" in refused["nameless.csv"]
    assert "cannot be of 'U03' too" in refused["U03_7.csv"]
    (inbox / "U01_5.csv").write_text(stand_in.content(1, 5))
    assert once(inbox, history).judged == 1


def test_names_that_are_no_utf_8_are_names_like_others(history: History, tmp_path: Path) -> None:
    inbox = tmp_path / os.fsdecode(b"bo\xeete")
    inbox.mkdir()
    put(inbox, 0)
    (inbox / os.fsdecode(b"caf\xe9.csv")).write_text("no recording")
    done = once(inbox, history, name="")
    assert (done.judged, done.refused) == (1, 1)
    (refused,) = history.events()
    assert refused.subject == r"caf\udce9.csv"
    assert once(inbox, history, name="").judged == 0


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_an_unreadable_file_is_refused(inbox: Path, history: History) -> None:
    put(inbox, 0, 1)
    (inbox / stand_in.name(1, 0)).chmod(0)
    assert once(inbox, history).judged == 1


def test_a_file_that_the_system_refuses_for_a_while_is_judged(
    inbox: Path, history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(inbox, 0, 1)
    left, real = [2], Path.open

    def failing(self: Path, *options: Any) -> Any:
        if self.name == stand_in.name(1, 0) and left[0]:
            left[0] -= 1
            raise OSError(5, "Input/output error")
        return real(self, *options)

    monkeypatch.setattr(Path, "open", failing)
    assert (once(inbox, history).judged, left) == (2, [0])


def test_an_unknown_unit_is_refused_unless_new_ones_are_taken(inbox: Path, history: History) -> None:
    put(inbox, 0)
    once(inbox, history)
    put(inbox, 0, unit=7)
    done = once(inbox, history, takes_new_units=False)
    assert (done.judged, done.refused) == (0, 1)
    (refused,) = history.events()
    assert "no unit 'U07' in the history" in refused.message
    assert "--new-units" in refused.message
    assert once(inbox, history).judged == 1


def test_a_late_recording_is_added_and_changes_nothing(inbox: Path, history: History) -> None:
    put(inbox, *range(8, 12))
    once(inbox, history)
    put(inbox, 7)  # with a fault
    once(inbox, history)
    assert len(judged(history)) == 5
    assert not history.events()


def test_a_folder_that_vanishes_and_returns(inbox: Path, history: History) -> None:
    with running(task(inbox, once=False), history):
        put(inbox, 0)
        wait_for(lambda: judged(history))
        inbox.rename(inbox.with_name("away"))
        wait_for(lambda: len(history.events()) == 1)
        inbox.with_name("away").rename(inbox)
        put(inbox, 1)
        wait_for(lambda: len(judged(history)) == 2)
    kinds = [(one.kind, one.state) for one in history.events()]
    assert kinds == [("source_lost", "raised"), ("source_lost", "cleared")]


def test_a_folder_that_is_not_there_is_refused_at_the_start(inbox: Path, history: History) -> None:
    with pytest.raises(MonitoringError, match="no such folder"):
        once(inbox / "none", history)


def test_once_does_not_wait_for_a_folder_that_vanished(
    inbox: Path, history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(WatchTask, "check", lambda _: inbox.rename(inbox.with_name("away")))
    assert once(inbox, history) == Watching()
    assert [(one.kind, one.state) for one in history.events()] == [("source_lost", "raised")]


def test_a_history_that_fails_is_waited_for(
    inbox: Path, history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(inbox, *range(19, 22))
    left, calls, real = [0], [0], Database.writing

    def failing(self: Database, *options: Any) -> Any:
        calls[0] += 1
        if calls[0] % 4 == 0:
            left[0] = 2
        if left[0]:
            left[0] -= 1
            raise HistoryUnavailableError("disk I/O error")
        return real(self, *options)

    monkeypatch.setattr(Database, "writing", failing)
    said: list[str] = []
    diagnosed: list[str] = []

    def diagnose(recording: Recording, actuator: Any, *, seed: int) -> Any:
        diagnosed.append(recording.source)
        return stand_in.diagnosed(recording, actuator, seed=seed)

    assert once(inbox, history, said, diagnose=diagnose).judged == 3
    assert len(diagnosed) == 3  # kept while the history failed
    assert len(judged(history)) == 3
    assert any("nothing is lost" in line for line in said)


def test_a_newer_history_ends_the_watching(inbox: Path, history: History) -> None:
    put(inbox, 0)

    def diagnose(recording: Recording, actuator: Any, *, seed: int) -> Any:
        with history.database.writing() as connection:
            connection.execute(VERSION.update().values(version_num="9999"))
        return stand_in.diagnosed(recording, actuator, seed=seed)

    with pytest.raises(HistoryFormError, match="newer version"):
        once(inbox, history, diagnose=diagnose)


def test_a_defect_of_a_diagnosis_does_not_end_the_watching(inbox: Path, history: History) -> None:
    put(inbox, 0, 1)

    def diagnose(recording: Recording, actuator: Any, *, seed: int) -> Any:
        if recording.source.endswith(stand_in.name(1, 0)):
            raise ZeroDivisionError
        return stand_in.diagnosed(recording, actuator, seed=seed)

    said: list[str] = []
    done = once(inbox, history, said, diagnose=diagnose)
    assert (done.judged, done.refused) == (1, 1)
    assert any("Traceback" in line for line in said)


def test_a_defect_of_a_reader_does_not_end_the_watching(
    inbox: Path, history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(inbox, 0, 1)

    def read(path: Path, *values: Any, real: Any = read_recordings, **options: Any) -> Any:
        if path.name == stand_in.name(1, 0):
            raise ZeroDivisionError
        return real(path, *values, **options)

    monkeypatch.setattr("emaphm.monitoring.folder.read_recordings", read)
    said: list[str] = []
    done = once(inbox, history, said)
    assert (done.judged, done.refused) == (1, 1)
    assert any("Traceback" in line for line in said)
    assert "a defect of emaphm" in history.events()[0].message


def test_back_pressure_is_said_and_taken_back(inbox: Path, history: History) -> None:
    put(inbox, *range(8, 18))

    def slow(recording: Recording, actuator: Any, *, seed: int) -> Any:
        time.sleep(0.02)
        return stand_in.diagnosed(recording, actuator, seed=seed)

    # Below what one takes: it is cleared once nothing waits any more.
    settings = replace(WRITTEN, pressure=PressureSettings(raise_s=0.1, clear_s=0.01))
    watch(task(inbox, diagnose=slow), history, THESIS, settings=settings)
    events = history.events()
    assert [(one.kind, one.state) for one in events] == [
        ("back_pressure", "raised"),
        ("back_pressure", "cleared"),
    ]
    assert events[0].details["waiting"] >= 4


# Webhooks


def test_a_webhook_gets_each_event_once_in_order(inbox: Path, history: History) -> None:
    put(inbox, *range(22, 26))
    with webhook() as hook:
        once(inbox, history, webhook=hook.url)
        once(inbox, history, webhook=hook.url)
    assert hook.events == [one.to_dict() for one in history.events()]
    assert hook.headers == [one.key for one in history.events()]


def test_a_webhook_that_fails_is_tried_again(inbox: Path, history: History) -> None:
    put(inbox, *range(22, 26))
    answers = iter([500, 503, 200, 429, 200])
    said: list[str] = []
    with webhook() as hook:
        hook.status = lambda: next(answers, 200)
        once(inbox, history, said, webhook=hook.url)
    assert [one["id"] for one in hook.events] == [one.key for one in history.events()]
    assert any("events wait in the history" in line for line in said)
    assert hook.url not in " ".join(said)  # its path may be a secret


def test_an_event_that_was_sent_and_cannot_be_noted_is_not_sent_again(
    inbox: Path, history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(inbox, *range(22, 26))
    noted, failures = WatchState.delivered, iter(range(4))

    def failing(state: WatchState, receiver: str, number: int) -> None:
        if number and next(failures, None) is not None:
            raise HistoryUnavailableError("the disk is full")
        noted(state, receiver, number)

    monkeypatch.setattr(WatchState, "delivered", failing)
    with webhook() as hook:
        once(inbox, history, webhook=hook.url)
    assert next(failures, None) is None
    assert hook.headers == [one.key for one in history.events()]


@pytest.mark.parametrize("address", ["https://user:secret@host/path", "https://host/pöth", "host/path"])
def test_an_address_that_nothing_could_be_sent_to_is_refused(address: str) -> None:
    with pytest.raises(MonitoringError, match="without user and password") as refused:
        Webhook(address, 1.0)
    assert "secret" not in str(refused.value)


def test_a_link_in_a_circle_does_not_hold_up_the_others(inbox: Path, history: History) -> None:
    put(inbox, 0, 1)
    (inbox / "circle.csv").symlink_to("circle.csv")
    found = once(inbox, history)
    assert (found.judged, found.refused) == (2, 1)
    assert "circle.csv" in history.events(kinds=["refused"])[0].message


def test_an_event_that_a_webhook_refuses_does_not_hold_up_the_others(inbox: Path, history: History) -> None:
    put(inbox, *range(22, 26))
    said: list[str] = []
    with webhook() as hook:
        refuse = [QUICK.delivery.tries]

        def status() -> int:
            refuse[0] -= 1
            return 400 if refuse[0] >= 0 else 200

        hook.status = status
        once(inbox, history, said, webhook=hook.url)
    assert [one["id"] for one in hook.events] == [one.key for one in history.events()][1:]
    assert any("passed over" in line for line in said)


def test_a_webhook_that_never_answers_holds_up_nothing_and_is_sent_all_later(
    inbox: Path, history: History
) -> None:
    put(inbox, *range(22, 26))
    settings = replace(WRITTEN, delivery=replace(WRITTEN.delivery, timeout_s=0.5, last_s=0.1))
    silent = threading.Event()
    with webhook() as hook:

        def status() -> int:
            silent.wait(PATIENCE_S)
            return 503

        hook.status = status
        began = time.monotonic()
        watch(task(inbox, webhook=hook.url), history, THESIS, settings=settings)
        assert time.monotonic() - began < 15
        assert len(judged(history)) == 4
        assert not hook.events
        silent.set()
        hook.status = lambda: 200
        once(inbox, history, webhook=hook.url)
        # In this process the first watcher's thread may still send: each event once at least.
        assert list(dict.fromkeys(one["id"] for one in hook.events)) == [one.key for one in history.events()]


@pytest.mark.parametrize("url", ["", "ftp://h/x", "http://", "http://h:99999/", "http://h/ x", "nonsense"])
def test_an_address_that_is_none_is_refused(inbox: Path, history: History, url: str) -> None:
    with pytest.raises(MonitoringError, match="--webhook"):
        once(inbox, history, webhook=url)


def test_a_new_webhook_is_not_sent_the_past(history: History) -> None:
    history.add_events(Event("refused", "raised", "warning", "old", watcher="w"))
    state = WatchState(history, "w")
    assert len(state.undelivered("lines", 10)) == 1
    state.skip_to_now("webhook")
    history.add_events(Event("refused", "raised", "warning", "new", watcher="w"))
    assert [one.message for one in state.undelivered("webhook", 10)] == ["new"]


# Whose


@pytest.mark.parametrize(
    ("pattern", "name", "expected"),
    [
        ("{unit}_{hours}.csv", "SN-4_12.5.csv", ("SN-4", 12.5, None)),
        ("{unit}_{hours}.csv", "A_B_7.csv", ("A_B", 7.0, None)),
        ("{any}-{unit}-h{hours}-c{cycles}.{any}", "rig-9-h3-c44.mat", ("9", 3.0, 44)),
    ],
)
def test_a_file_name_says_whose_it_is(pattern: str, name: str, expected: tuple[object, ...]) -> None:
    entry = Ownership("P", pattern=NamePattern.parse(pattern)).entry(name, {})
    assert (entry.unit, entry.hours, entry.cycles) == expected


def test_a_name_goes_before_columns_and_these_before_options() -> None:
    ownership = Ownership("P", "option", 1.0, NamePattern.parse("{unit}.csv"))
    assert ownership.entry("a.csv", {"unit": "label", "hours": 2.0, "cycles": 5.0}).unit == "a"
    entry = ownership.entry("a.mat", {"serial": 42.0, "hours": "3.5"})
    assert (entry.unit, entry.hours) == ("42", 3.5)
    assert ownership.entry("a.mat", {}).unit == "option"


@pytest.mark.parametrize("pattern", ["{units}.csv", "{unit}_{unit}.csv", "plain.csv", "{any}.csv"])
def test_a_pattern_that_says_nothing_is_refused(pattern: str) -> None:
    with pytest.raises(MonitoringError, match="--name"):
        NamePattern.parse(pattern)


# Streams


def rows(
    hours: float, start: float = 0.0, *, fault: float = 0.0, movements: int = 1, unit: str = "S1"
) -> list[str]:
    """Return rows at 100 Hz: movements of 1 s, each with 1.5 s of rest before and after."""
    time = np.arange(0, 4 * movements, 0.01)
    moving = (time % 4 > 1.5) & (time % 4 < 2.5)
    command = np.where(moving, 5e-3 * np.sin(8 * np.pi * (time % 4 - 1.5)), 0.0)
    return [
        json.dumps(
            {"unit": unit, "hours": hours, "time_s": t, "command_rad": c, "current_A": fault + 1e-4 * t}
        )
        + "\n"
        for t, c in zip((start + time).round(4).tolist(), command.tolist(), strict=True)
    ]


def stream(lines: list[str], history: History, *, settings: WatchSettings = FAST, **options: Any) -> Watching:
    """Watch lines that come on a pipe."""
    out, into = os.pipe()

    def write() -> None:
        with os.fdopen(into, "w") as pipe, suppress(BrokenPipeError):
            pipe.writelines(lines)

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    try:
        usual: dict[str, Any] = {"ownership": Ownership(THESIS.name), "name": "pipe"}
        return watch(task(out, **usual | options), history, THESIS, settings=settings)
    finally:
        os.close(out)
        writer.join(PATIENCE_S)


def test_movements_of_a_stream_are_judged_and_those_sent_again_are_not(history: History) -> None:
    first = rows(1.0, movements=3)
    assert stream(first, history).judged == 3
    assert stream(first, history).judged == 0  # all of it again
    assert stream(rows(1.0, movements=5), history).judged == 2  # and further rows of the flight
    assert stream(rows(2.0, movements=1), history).judged == 1
    assert stream(first, history).judged == 0
    names = [one.recording for one in history.unit("S1").diagnoses()]
    assert len(names) == 6
    assert names[0].startswith("S1 at 1 h, 0.000 to 3.")


def test_a_stream_cut_anywhere_and_sent_again_is_judged_once(history: History) -> None:
    lines = rows(1.0, movements=3)
    for stop in range(150, len(lines), 130):
        settled = lines[:stop]
        stream(settled, history)
    stream(lines, history)
    spans = [one.recording.partition(", ")[2].split(" ") for one in history.unit("S1").diagnoses()]
    ends = [(float(a), float(b)) for a, _, b, _ in spans]
    assert all(one[1] < other[0] for one, other in pairwise(ends)), ends


def test_rows_out_of_order_and_a_clock_that_is_set_back(history: History) -> None:
    lines = rows(1.0, start=100.0, movements=2)
    lines[50], lines[60] = lines[60], lines[50]
    assert stream(lines + rows(1.0, start=20.0, movements=2), history).judged == 4
    (event,) = history.events(kinds=["rows_skipped"])
    assert "clock was set back" in event.message


def test_units_of_one_stream_are_kept_apart(history: History) -> None:
    one, other = rows(1.0, movements=2), rows(5.0, unit="S2", movements=2)
    mixed = [line for pair in zip(one, other, strict=True) for line in pair]
    assert stream(mixed, history).judged == 4
    assert judged(history) == [("S1", 1.0)] * 2 + [("S2", 5.0)] * 2


FEW_UNITS = replace(FAST, stream=replace(FAST.stream, most_units=3))


def test_of_more_units_at_once_than_are_held_some_are_judged_and_the_others_said(history: History) -> None:
    most = FEW_UNITS.stream.most_units
    each = [rows(1.0, unit=f"S{number}", fault=0.01 * number) for number in range(most + 2)]
    mixed = [line for lines in zip(*each, strict=True) for line in lines]
    assert stream(mixed, history, settings=FEW_UNITS).judged == most
    assert len(judged(history)) == most
    left_out = [one.details for one in history.events(kinds=["rows_skipped"])]
    # All rows of two units, but those by which the others were seen to be more.
    assert sum(one[f"of more than {most} units at once"] for one in left_out) == 2 * len(each[0]) - 2


def test_more_units_one_after_the_other_are_all_judged(history: History) -> None:
    most = FEW_UNITS.stream.most_units
    each = [rows(1.0, unit=f"S{number}", fault=0.01 * number) for number in range(most + 2)]
    mixed = [line for lines in each for line in lines]
    assert stream(mixed, history, settings=FEW_UNITS).judged == most + 2
    assert not history.events(kinds=["rows_skipped"])


def relabelled(lines: list[str], first: int, **labels: float) -> list[str]:
    """Return rows of which those from `first` on have other labels."""
    return [*lines[:first], *(json.dumps(json.loads(line) | labels) + "\n" for line in lines[first:])]


def test_hours_that_tick_in_a_movement_end_it_and_what_follows_is_not_judged(history: History) -> None:
    lines = rows(1.0, movements=3)
    assert stream(relabelled(lines, 600, hours=1.1), history).judged == 3
    spans = [one.recording.partition(" at ")[2] for one in history.unit("S1").diagnoses()]
    assert spans == ["1 h, 0.000 to 3.500 s", "1 h, 3.510 to 5.990 s", "1.1 h, 7.500 to 11.500 s"]
    # One event, or two: what was left out so far is said at once, the rest at the end.
    skipped = [one.details for one in history.events(kinds=["rows_skipped"])]
    assert {why for one in skipped for why in one} == {"in a movement whose beginning is not known"}
    # From 6 s until the command has rested for 1 s, since 6.5 s.
    assert sum(sum(one.values()) for one in skipped) == 150
    assert stream(relabelled(rows(2.0, movements=2), 400, hours=2.1), history).judged == 2


def test_cycles_that_tick_in_a_movement_are_those_of_its_flight(history: History) -> None:
    lines = relabelled(relabelled(rows(1.0, movements=3), 0, cycles=100), 600, cycles=101)
    done = stream(lines, history)
    assert (done.judged, done.refused) == (3, 0)
    (flight,) = history.unit("S1").flights()
    assert flight.cycles == 100


def test_the_rest_of_a_movement_that_was_judged_in_part_is_not_judged(history: History) -> None:
    lines = rows(1.0, movements=2)
    assert stream(lines[:200], history).judged == 1
    assert stream(lines, history).judged == 1
    spans = [one.recording.partition(", ")[2] for one in history.unit("S1").diagnoses()]
    assert spans == ["0.000 to 1.990 s", "3.500 to 7.500 s"]


def test_rows_that_are_none_are_counted(history: History) -> None:
    lines = rows(1.0)
    odd = [
        "nonsense\n",
        '{"unit": "S1", "hours": 1.0, "time_s": 9}\n',
        '{"time_s": 9, "command_rad": 0}\n',
        '{"unit": "S1", "hours": 1.0, "time_s": 9, "command_rad": Infinity}\n',
    ]
    done = stream(lines[:100] + odd + lines[100:], history)
    assert (done.judged, done.rows_left_out) == (1, 4)
    # One event, or two: what was left out so far is said at once, the rest at the end.
    events = history.events()
    assert {one.kind for one in events} == {"rows_skipped"}
    assert sum(sum(one.details.values()) for one in events) == 4


def test_rows_that_nobody_says_the_hours_of_are_left_out_with_what_to_do(history: History) -> None:
    lines = [{name: v for name, v in json.loads(line).items() if name != "hours"} for line in rows(1.0)]
    done = stream([json.dumps(line) + "\n" for line in lines], history)
    assert done.judged == 0
    assert f"0 refused, {len(lines)} rows left out; 0 prognoses" in str(done)
    (event,) = history.events()
    assert event.message == (
        f"{len(lines)} rows were left out: their hours are not known; give --hours or a column 'hours'"
    )


def test_a_stream_as_csv_by_the_command_alone(history: History) -> None:
    lines = [json.loads(line) for line in rows(1.0)]
    names = ("time_s", "command_rad", "current_A")
    text = [",".join(names) + "\n", *(",".join(str(row[name]) for name in names) + "\n" for row in lines)]
    assert stream(text, history, ownership=Ownership(THESIS.name, "S9", 3.0)).judged == 1
    assert judged(history) == [("S9", 3.0)]


def test_a_sender_that_is_too_fast_is_held_back(history: History, monkeypatch: pytest.MonkeyPatch) -> None:
    sources, begin = list[StreamSource](), StreamSource.__post_init__

    def begun(self: StreamSource) -> None:
        begin(self)
        sources.append(self)

    def slow(recording: Recording, actuator: Any, *, seed: int) -> Any:
        if len(history.units()) == 0:  # the first one takes until no further one fits
            wait_for(lambda: sources[0].is_held_back)
        return stand_in.diagnosed(recording, actuator, seed=seed)

    monkeypatch.setattr(StreamSource, "__post_init__", begun)
    most = QUICK.stream.queue + 4
    assert stream(rows(1.0, movements=most), history, diagnose=slow).judged == most
    kinds = [(one.kind, one.state) for one in history.events()]
    # Once, or again where the reading was slow in between.
    assert kinds
    assert kinds == [("back_pressure", "raised"), ("back_pressure", "cleared")] * (len(kinds) // 2)


def test_foreign_columns_of_a_stream_are_read_as_described(history: History) -> None:
    from emaphm.actuator import Actuator

    values = THESIS.model_dump(mode="json") | {
        "channels": {
            "time_s": {"column": "ms", "unit": "ms"},
            "command_rad": {"column": "cmd", "unit": "mrad"},
        }
    }
    described = Actuator.from_dict(values, where="test")
    lines = [json.loads(line) for line in rows(1.0)]
    text = [
        json.dumps(
            {"ms": 1e3 * row["time_s"], "cmd": 1e3 * row["command_rad"], "current_A": row["current_A"]}
        )
        + "\n"
        for row in lines
    ]
    out, into = os.pipe()
    with os.fdopen(into, "w") as pipe:
        pipe.writelines(text)
    found: list[Recording] = []

    def diagnose(recording: Recording, actuator: Any, *, seed: int) -> Any:
        found.append(recording)
        return stand_in.diagnosed(recording, actuator, seed=seed)

    one = task(out, ownership=Ownership(THESIS.name, "S9", 3.0), name="pipe", diagnose=diagnose)
    assert watch(one, history, described, settings=FAST).judged == 1
    assert found[0].interval_s == pytest.approx(0.01)
    assert np.ptp(found[0]["command_rad"]) == pytest.approx(0.01, rel=0.01)
    os.close(out)


def test_a_full_disk_is_waited_for(inbox: Path, history: History) -> None:
    put(inbox, *range(8, 28))
    said: list[str] = []
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    # Python ignores the signal, and writing beyond the limit fails as on a full disk.
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, limits[1]))
    try:
        with running(task(inbox, once=False), history, said, WRITTEN):
            wait_for(lambda: said)
            assert "free space there" in said[0]
            held = judged(history)
            assert held
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
            wait_for(lambda: count(history) == 20)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert set(held) <= set(judged(history))
    assert len(set(judged(history))) == 20
    assert "can be used again" in said[-1]


def test_a_receiver_that_stays_away_is_not_asked_without_a_pause(inbox: Path, history: History) -> None:
    put(inbox, *range(22, 26))
    with webhook() as hook:
        hook.status = lambda: 503
        settings = replace(WRITTEN, delivery=replace(FAST.delivery, last_s=0.2))
        watch(task(inbox, webhook=hook.url), history, THESIS, settings=settings)
        assert 1 <= hook.attempts < 8
