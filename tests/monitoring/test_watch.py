"""Watching a folder and a stream: each recording is judged once despite interruptions and errors."""

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
from emaphm.errors import (
    EmaphmError,
    HistoryFormError,
    HistoryUnavailableError,
    MonitoringError,
    RecordingError,
)
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
"""Settings for files that are complete before the watcher starts."""


def write_recordings(folder: Path, *numbers: int, unit: int = 1) -> None:
    for number in numbers:
        (folder / stand_in.name(unit, number)).write_text(stand_in.content(unit, number))


def task(source: Path | int, **options: Any) -> WatchTask:
    defaults: dict[str, Any] = {
        "ownership": Ownership(THESIS.name, pattern=PATTERN),
        "name": "test",
        "cut": None,
        "diagnose": stand_in.diagnosed,
        "takes_new_units": True,
        "once": True,
    }
    return WatchTask(source, **defaults | options)


@pytest.fixture
def inbox(tmp_path: Path) -> Path:
    folder = tmp_path / "in"
    folder.mkdir()
    return folder


def judged_recordings(history: History) -> list[tuple[str, float]]:
    return [(unit.serial_number, kept.hours) for unit in history.units() for kept in unit.diagnoses()]


def count_diagnoses(history: History) -> int:
    """Return the number of diagnoses, which is quicker than reading them."""
    with history.database.reading() as connection:
        return connection.execute(sa.select(sa.func.count()).select_from(DIAGNOSES)).scalar_one()


@contextmanager
def running(
    task: WatchTask, history: History, messages: list[str] | None = None, settings: WatchSettings = FAST
) -> Iterator[None]:
    """Watch in a thread while the body runs."""
    stop, failures, received = (
        threading.Event(),
        list[BaseException](),
        messages if messages is not None else [],
    )

    def run() -> None:
        try:
            watch(task, history, THESIS, settings=settings, stop=stop, say=received.append)
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


def watch_once(folder: Path, history: History, messages: list[str] | None = None, **options: Any) -> Watching:
    received = messages if messages is not None else []
    return watch(task(folder, **options), history, THESIS, settings=WRITTEN, say=received.append)


def test_each_file_is_judged_once(inbox: Path, history: History) -> None:
    write_recordings(inbox, 0, 1)
    write_recordings(inbox, 0, unit=2)
    assert watch_once(inbox, history).judged == 3
    assert judged_recordings(history) == [("U01", 0.0), ("U01", 0.24), ("U02", 0.0)]
    write_recordings(inbox, 2)
    again = watch_once(inbox, history)
    assert (again.judged, again.known) == (1, 0)
    (inbox / stand_in.name(1, 0)).touch()  # a new time stamp with the same content
    assert (watch_once(inbox, history).judged, len(history.events(kinds=["refused"]))) == (0, 0)


def test_each_piece_of_a_file_belongs_to_the_unit_in_its_rows(inbox: Path, history: History) -> None:
    lines = []
    for i, (unit, hours) in enumerate((("20240000000017", 10), ("20240000000018", 20))):
        header, *rows = stand_in.content(1, i).splitlines()
        lines += [f"{row},{unit},{hours}" for row in rows]
    (inbox / "day.csv").write_text("\n".join([f"{header},unit,hours", *lines]) + "\n")
    assert watch_once(inbox, history, ownership=Ownership(THESIS.name), split="unit").judged == 2
    assert judged_recordings(history) == [("20240000000017", 10.0), ("20240000000018", 20.0)]
    (inbox / "long.csv").write_text(
        "\n".join([f"{header},unit,hours", *(f"{row},123456789012345678901,5" for row in rows)]) + "\n"
    )
    assert watch_once(inbox, history, ownership=Ownership(THESIS.name)).refused == 1
    assert "more digits than a number keeps" in history.events(kinds=["refused"])[-1].message


@pytest.mark.parametrize("unit", ["3.10", "3.1", "1e-2"])
def test_a_unit_that_is_a_number_with_decimals_is_refused(unit: str, inbox: Path, history: History) -> None:
    (inbox / "day.csv").write_text(of_units(unit))
    assert watch_once(inbox, history, ownership=Ownership(THESIS.name)).refused == 1
    message = history.events(kinds=["refused"])[-1].message
    assert "with decimals" in message
    assert "write it with a letter" in message


def test_hours_and_textual_serial_numbers_may_have_decimals() -> None:
    entry = Ownership(THESIS.name).entry("day.csv", {"unit": "3.10", "hours": 812.5})
    assert (entry.unit, entry.hours) == ("3.10", 812.5)
    assert Ownership(THESIS.name).entry("day.csv", {"unit": 17.0, "hours": 812.5}).unit == "17"


@pytest.mark.parametrize(("hours", "message"), [(float("inf"), "no number"), (1e17, "from 0 to 1,000,000")])
def test_impossible_hours_are_refused_as_hours(hours: float, message: str) -> None:
    with pytest.raises(EmaphmError, match=message):
        Ownership(THESIS.name, "S1").entry("day.csv", {"hours": hours})


@pytest.mark.parametrize("cycles", [12.6, -1.0, "many", 1e12, 1e17, float("inf")])
def test_cycles_that_are_not_whole_numbers_are_refused(cycles: float | str) -> None:
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


def test_only_refused_pieces_of_a_file_are_tried_again_at_the_next_start(
    inbox: Path, history: History
) -> None:
    stand_in.fly(history, [0.1])
    (inbox / "day.csv").write_text(of_units("S1", "S2"))

    def counts(**options: Any) -> tuple[int, int, int]:
        result = watch_once(inbox, history, ownership=Ownership(THESIS.name), split="unit", **options)
        return result.judged, result.known, result.refused

    assert counts(takes_new_units=False) == (1, 0, 1)
    assert counts(takes_new_units=False) == (0, 1, 1)
    assert len(history.events(kinds=["refused"])) == 1
    assert counts() == (1, 1, 0)
    assert counts() == (0, 0, 0)
    assert judged_recordings(history) == [("S1", 0.0), ("S1", 0.0), ("S2", 1.0)]


def test_a_partly_judged_file_that_changes_is_not_judged_again(inbox: Path, history: History) -> None:
    stand_in.fly(history, [0.1])
    for units in (("S1", "S2"), ("S1", "S2", "S1")):
        (inbox / "day.csv").write_text(of_units(*units))
        result = watch_once(
            inbox, history, ownership=Ownership(THESIS.name), split="unit", takes_new_units=False
        )
        assert result.refused == 1
    assert "was changed after it was judged" in history.events(kinds=["refused"])[-1].message
    assert len(judged_recordings(history)) == 2


def test_each_event_is_written_as_a_line_once(inbox: Path, history: History, tmp_path: Path) -> None:
    write_recordings(inbox, *range(19, 25))
    with (tmp_path / "lines").open("wb") as lines:
        watch_once(inbox, history, lines=lines.fileno())
        watch_once(inbox, history, lines=lines.fileno())
    values = [json.loads(line) for line in (tmp_path / "lines").read_text().splitlines()]
    assert values == [event.to_dict() for event in history.events()]
    assert [(event["event"], event["state"]) for event in values] == [
        ("health_changed", "raised"),
        ("alarm", "raised"),
    ]


def test_a_watcher_interrupted_at_any_transaction_continues_without_loss(
    inbox: Path, history: History
) -> None:
    """The watcher is interrupted once at the first transaction, once at the second, and so on."""
    write_recordings(inbox, *range(22, 26))
    counts = iter(range(1, 200))
    was_interrupted = True
    while was_interrupted:
        was_interrupted = False
        transactions_left = [next(counts)]

        def interrupted(
            self: Database,
            *_: Any,
            transactions_left: list[int] = transactions_left,
            real: Any = Database.writing,
        ) -> Any:
            transactions_left[0] -= 1
            if transactions_left[0] == 0:
                raise KeyboardInterrupt
            return real(self)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Database, "writing", interrupted)
            try:
                watch_once(inbox, history)
            except KeyboardInterrupt:
                was_interrupted = True
    assert judged_recordings(history) == [("U01", round(i * stand_in.FLIGHT_H, 2)) for i in range(22, 26)]
    kinds = [(event.kind, event.state) for event in history.events()]
    assert kinds == [("health_changed", "raised"), ("alarm", "raised"), ("health_changed", "raised")]


def test_a_file_is_judged_only_when_it_no_longer_grows(
    inbox: Path, history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The test uses a clock that advances only between two polls, independently of the machine's load."""
    text = stand_in.content(1, 0)
    clock, polls, poll = [0.0], [0], FolderSource._poll

    def counted(self: FolderSource) -> None:
        poll(self)
        polls[0] += 1

    def advance_and_poll(seconds: float) -> None:
        before = polls[0]
        clock[0] += seconds
        wait_for(lambda: polls[0] > before)

    monkeypatch.setattr(FolderSource, "_poll", counted)
    monkeypatch.setattr("emaphm.monitoring.folder.time", SimpleNamespace(monotonic=lambda: clock[0]))
    settings = replace(FAST, folder=replace(FAST.folder, settle_s=1.5))
    with running(task(inbox, once=False), history, settings=settings):
        with (inbox / stand_in.name(1, 0)).open("w") as file:
            for i in range(0, len(text), len(text) // 8):
                file.write(text[i : i + len(text) // 8])
                file.flush()
                advance_and_poll(1.0)
                assert not judged_recordings(history)
        advance_and_poll(1.0)
        assert not judged_recordings(history)
        advance_and_poll(1.0)
        wait_for(lambda: judged_recordings(history))
    (kept,) = history.unit("U01").diagnoses()
    assert json.loads(kept.text)["recording"] == str(inbox / stand_in.name(1, 0))
    assert not history.events(kinds=["refused"])


def test_a_judged_file_that_changes_is_refused_once(inbox: Path, history: History) -> None:
    write_recordings(inbox, 0)
    watch_once(inbox, history)
    path = inbox / stand_in.name(1, 0)
    path.write_text(path.read_text() + "0.0600,0.001,1.0\n")
    for _ in range(2):
        watch_once(inbox, history)
    assert len(judged_recordings(history)) == 1
    (refused,) = history.events(kinds=["refused"])
    assert "was changed after it was judged" in refused.message


def test_unusable_files_are_reported_once_and_tried_again_at_the_next_start(
    inbox: Path, history: History
) -> None:
    write_recordings(inbox, 0)
    (inbox / "U01_5.csv").write_text("no recording")
    (inbox / "nameless.csv").write_text(stand_in.content(1, 3))
    (inbox / "U03_7.csv").write_text(stand_in.content(1, 0))  # the same rows for another unit
    (inbox / "U04_1.csv").mkdir()
    (inbox / ".hidden.csv").write_text("no recording")
    (inbox / "note.txt").write_text("no recording")
    messages = list[str]()
    for _ in range(2):
        assert watch_once(inbox, history, messages).refused == 3
    assert len([line for line in messages if "refused as before" in line]) == 3  # their events exist already
    refused = {event.subject: event.message for event in history.events()}
    assert set(refused) == {"U01_5.csv", "nameless.csv", "U03_7.csv"}
    assert "its unit is not known" in refused["nameless.csv"]
    assert "cannot be of 'U03' too" in refused["U03_7.csv"]
    (inbox / "U01_5.csv").write_text(stand_in.content(1, 5))
    assert watch_once(inbox, history).judged == 1


def test_file_names_that_are_not_utf_8_are_accepted(history: History, tmp_path: Path) -> None:
    inbox = tmp_path / os.fsdecode(b"bo\xeete")
    inbox.mkdir()
    write_recordings(inbox, 0)
    (inbox / os.fsdecode(b"caf\xe9.csv")).write_text("no recording")
    result = watch_once(inbox, history, name="")
    assert (result.judged, result.refused) == (1, 1)
    (refused,) = history.events()
    assert refused.subject == r"caf\udce9.csv"
    assert watch_once(inbox, history, name="").judged == 0


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_an_unreadable_file_does_not_stop_the_others(inbox: Path, history: History) -> None:
    write_recordings(inbox, 0, 1)
    (inbox / stand_in.name(1, 0)).chmod(0)
    assert watch_once(inbox, history).judged == 1


def test_a_file_with_temporary_read_errors_is_judged(
    inbox: Path, history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_recordings(inbox, 0, 1)
    failures_left, real = [2], Path.open

    def failing(self: Path, *options: Any) -> Any:
        if self.name == stand_in.name(1, 0) and failures_left[0]:
            failures_left[0] -= 1
            raise OSError(5, "Input/output error")
        return real(self, *options)

    monkeypatch.setattr(Path, "open", failing)
    assert (watch_once(inbox, history).judged, failures_left) == (2, [0])


def test_an_unknown_unit_is_refused_unless_new_units_are_allowed(inbox: Path, history: History) -> None:
    write_recordings(inbox, 0)
    watch_once(inbox, history)
    write_recordings(inbox, 0, unit=7)
    result = watch_once(inbox, history, takes_new_units=False)
    assert (result.judged, result.refused) == (0, 1)
    (refused,) = history.events()
    assert "no unit 'U07' in the history" in refused.message
    assert "--new-units" in refused.message
    assert watch_once(inbox, history).judged == 1


def test_a_late_recording_is_added_without_events(inbox: Path, history: History) -> None:
    write_recordings(inbox, *range(8, 12))
    watch_once(inbox, history)
    write_recordings(inbox, 7)  # with a fault
    watch_once(inbox, history)
    assert len(judged_recordings(history)) == 5
    assert not history.events()


def test_a_folder_that_disappears_and_returns_raises_and_clears_a_condition(
    inbox: Path, history: History
) -> None:
    with running(task(inbox, once=False), history):
        write_recordings(inbox, 0)
        wait_for(lambda: judged_recordings(history))
        inbox.rename(inbox.with_name("away"))
        wait_for(lambda: len(history.events()) == 1)
        inbox.with_name("away").rename(inbox)
        write_recordings(inbox, 1)
        wait_for(lambda: len(judged_recordings(history)) == 2)
    kinds = [(event.kind, event.state) for event in history.events()]
    assert kinds == [("source_lost", "raised"), ("source_lost", "cleared")]


def test_a_missing_folder_is_refused_at_the_start(inbox: Path, history: History) -> None:
    with pytest.raises(MonitoringError, match="no such folder"):
        watch_once(inbox / "none", history)


def test_with_once_a_watcher_does_not_wait_for_a_folder_that_disappeared(
    inbox: Path, history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(WatchTask, "check", lambda _: inbox.rename(inbox.with_name("away")))
    assert watch_once(inbox, history) == Watching()
    assert [(event.kind, event.state) for event in history.events()] == [("source_lost", "raised")]


def test_a_watcher_retries_a_failing_history_without_repeating_diagnoses(
    inbox: Path, history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_recordings(inbox, *range(19, 22))
    failures_left, calls, real = [0], [0], Database.writing

    def failing(self: Database, *options: Any) -> Any:
        calls[0] += 1
        if calls[0] % 4 == 0:
            failures_left[0] = 2
        if failures_left[0]:
            failures_left[0] -= 1
            raise HistoryUnavailableError("disk I/O error")
        return real(self, *options)

    monkeypatch.setattr(Database, "writing", failing)
    messages: list[str] = []
    diagnosed: list[str] = []

    def diagnose(recording: Recording, actuator: Any, *, seed: int) -> Any:
        diagnosed.append(recording.source)
        return stand_in.diagnosed(recording, actuator, seed=seed)

    assert watch_once(inbox, history, messages, diagnose=diagnose).judged == 3
    assert len(diagnosed) == 3  # kept while the history failed
    assert len(judged_recordings(history)) == 3
    assert any("nothing is lost" in line for line in messages)


def test_a_history_of_a_newer_version_ends_the_watcher(inbox: Path, history: History) -> None:
    write_recordings(inbox, 0)

    def diagnose(recording: Recording, actuator: Any, *, seed: int) -> Any:
        with history.database.writing() as connection:
            connection.execute(VERSION.update().values(version_num="9999"))
        return stand_in.diagnosed(recording, actuator, seed=seed)

    with pytest.raises(HistoryFormError, match="newer version"):
        watch_once(inbox, history, diagnose=diagnose)


def test_an_unexpected_error_in_a_diagnosis_does_not_end_the_watcher(inbox: Path, history: History) -> None:
    write_recordings(inbox, 0, 1)

    def diagnose(recording: Recording, actuator: Any, *, seed: int) -> Any:
        if recording.source.endswith(stand_in.name(1, 0)):
            raise ZeroDivisionError
        return stand_in.diagnosed(recording, actuator, seed=seed)

    messages: list[str] = []
    result = watch_once(inbox, history, messages, diagnose=diagnose)
    assert (result.judged, result.refused) == (1, 1)
    assert any("Traceback" in line for line in messages)


def test_an_unexpected_error_in_a_reader_does_not_end_the_watcher(
    inbox: Path, history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_recordings(inbox, 0, 1)

    def read(path: Path, *values: Any, real: Any = read_recordings, **options: Any) -> Any:
        if path.name == stand_in.name(1, 0):
            raise ZeroDivisionError
        return real(path, *values, **options)

    monkeypatch.setattr("emaphm.monitoring.folder.read_recordings", read)
    messages: list[str] = []
    result = watch_once(inbox, history, messages)
    assert (result.judged, result.refused) == (1, 1)
    assert any("Traceback" in line for line in messages)
    assert "a defect of emaphm" in history.events()[0].message


def test_back_pressure_is_raised_and_cleared(inbox: Path, history: History) -> None:
    write_recordings(inbox, *range(8, 18))

    def slow(recording: Recording, actuator: Any, *, seed: int) -> Any:
        time.sleep(0.02)
        return stand_in.diagnosed(recording, actuator, seed=seed)

    # Less than the time of a diagnosis, so the condition is cleared when no file waits.
    settings = replace(WRITTEN, pressure=PressureSettings(raise_s=0.1, clear_s=0.01))
    watch(task(inbox, diagnose=slow), history, THESIS, settings=settings)
    events = history.events()
    assert [(event.kind, event.state) for event in events] == [
        ("back_pressure", "raised"),
        ("back_pressure", "cleared"),
    ]
    assert events[0].details["waiting"] >= 4


# Webhooks


def test_a_webhook_receives_each_event_once_in_order(inbox: Path, history: History) -> None:
    write_recordings(inbox, *range(22, 26))
    with webhook() as hook:
        watch_once(inbox, history, webhook=hook.url)
        watch_once(inbox, history, webhook=hook.url)
    assert hook.events == [event.to_dict() for event in history.events()]
    assert hook.headers == [event.key for event in history.events()]


def test_events_are_sent_again_after_errors_of_a_webhook(inbox: Path, history: History) -> None:
    write_recordings(inbox, *range(22, 26))
    answers = iter([500, 503, 200, 429, 200])
    messages: list[str] = []
    with webhook() as hook:
        hook.status = lambda: next(answers, 200)
        watch_once(inbox, history, messages, webhook=hook.url)
    assert [event["id"] for event in hook.events] == [event.key for event in history.events()]
    assert any("events wait in the history" in line for line in messages)
    assert hook.url not in " ".join(messages)  # its path may be a secret


def test_a_delivered_event_is_not_sent_again_if_its_delivery_cannot_be_stored(
    inbox: Path, history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_recordings(inbox, *range(22, 26))
    delivered, failures = WatchState.delivered, iter(range(4))

    def failing(state: WatchState, receiver: str, number: int) -> None:
        if number and next(failures, None) is not None:
            raise HistoryUnavailableError("the disk is full")
        delivered(state, receiver, number)

    monkeypatch.setattr(WatchState, "delivered", failing)
    with webhook() as hook:
        watch_once(inbox, history, webhook=hook.url)
    assert next(failures, None) is None
    assert hook.headers == [event.key for event in history.events()]


@pytest.mark.parametrize("address", ["https://user:secret@host/path", "https://host/pöth", "host/path"])
def test_an_unusable_webhook_address_is_refused(address: str) -> None:
    with pytest.raises(MonitoringError, match="without user and password") as refused:
        Webhook(address, 1.0)
    assert "secret" not in str(refused.value)


def test_a_circular_link_is_refused_and_other_files_are_judged(inbox: Path, history: History) -> None:
    write_recordings(inbox, 0, 1)
    (inbox / "circle.csv").symlink_to("circle.csv")
    result = watch_once(inbox, history)
    assert (result.judged, result.refused) == (2, 1)
    assert "circle.csv" in history.events(kinds=["refused"])[0].message


def test_an_event_refused_by_a_webhook_does_not_block_later_events(inbox: Path, history: History) -> None:
    write_recordings(inbox, *range(22, 26))
    messages: list[str] = []
    with webhook() as hook:
        refusals_left = [QUICK.delivery.tries]

        def status() -> int:
            refusals_left[0] -= 1
            return 400 if refusals_left[0] >= 0 else 200

        hook.status = status
        watch_once(inbox, history, messages, webhook=hook.url)
    assert [event["id"] for event in hook.events] == [event.key for event in history.events()][1:]
    assert any("passed over" in line for line in messages)


def test_a_silent_webhook_does_not_block_the_watcher_and_receives_all_events_later(
    inbox: Path, history: History
) -> None:
    write_recordings(inbox, *range(22, 26))
    settings = replace(WRITTEN, delivery=replace(WRITTEN.delivery, timeout_s=0.5, last_s=0.1))
    silent = threading.Event()
    with webhook() as hook:

        def status() -> int:
            silent.wait(PATIENCE_S)
            return 503

        hook.status = status
        start = time.monotonic()
        watch(task(inbox, webhook=hook.url), history, THESIS, settings=settings)
        assert time.monotonic() - start < 15
        assert len(judged_recordings(history)) == 4
        assert not hook.events
        silent.set()
        hook.status = lambda: 200
        watch_once(inbox, history, webhook=hook.url)
        # The first watcher's thread may still send in this process, so an event may be received twice.
        assert list(dict.fromkeys(event["id"] for event in hook.events)) == [
            event.key for event in history.events()
        ]


@pytest.mark.parametrize("url", ["", "ftp://h/x", "http://", "http://h:99999/", "http://h/ x", "nonsense"])
def test_an_invalid_webhook_address_is_refused(inbox: Path, history: History, url: str) -> None:
    with pytest.raises(MonitoringError, match="--webhook"):
        watch_once(inbox, history, webhook=url)


def test_a_new_webhook_does_not_receive_past_events(history: History) -> None:
    history.add_events(Event("refused", "raised", "warning", "old", watcher="w"))
    state = WatchState(history, "w")
    assert len(state.undelivered("lines", 10)) == 1
    state.skip_to_now("webhook")
    history.add_events(Event("refused", "raised", "warning", "new", watcher="w"))
    assert [event.message for event in state.undelivered("webhook", 10)] == ["new"]


# Unit, hours and cycles of a recording


@pytest.mark.parametrize(
    ("pattern", "name", "expected"),
    [
        ("{unit}_{hours}.csv", "SN-4_12.5.csv", ("SN-4", 12.5, None)),
        ("{unit}_{hours}.csv", "A_B_7.csv", ("A_B", 7.0, None)),
        ("{any}-{unit}-h{hours}-c{cycles}.{any}", "rig-9-h3-c44.mat", ("9", 3.0, 44)),
    ],
)
def test_unit_hours_and_cycles_are_read_from_a_file_name(
    pattern: str, name: str, expected: tuple[object, ...]
) -> None:
    entry = Ownership("P", pattern=NamePattern.parse(pattern)).entry(name, {})
    assert (entry.unit, entry.hours, entry.cycles) == expected


def test_the_file_name_has_priority_over_columns_and_columns_over_options() -> None:
    ownership = Ownership("P", "option", 1.0, NamePattern.parse("{unit}.csv"))
    assert ownership.entry("a.csv", {"unit": "label", "hours": 2.0, "cycles": 5.0}).unit == "a"
    entry = ownership.entry("a.mat", {"serial": 42.0, "hours": "3.5"})
    assert (entry.unit, entry.hours) == ("42", 3.5)
    assert ownership.entry("a.mat", {}).unit == "option"


@pytest.mark.parametrize("pattern", ["{units}.csv", "{unit}_{unit}.csv", "plain.csv", "{any}.csv"])
def test_an_invalid_name_pattern_is_refused(pattern: str) -> None:
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


def watch_stream(
    lines: list[str], history: History, *, settings: WatchSettings = FAST, **options: Any
) -> Watching:
    """Watch lines that are written to a pipe."""
    out, into = os.pipe()

    def write() -> None:
        with os.fdopen(into, "w") as pipe, suppress(BrokenPipeError):
            pipe.writelines(lines)

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    try:
        defaults: dict[str, Any] = {"ownership": Ownership(THESIS.name), "name": "pipe"}
        return watch(task(out, **defaults | options), history, THESIS, settings=settings)
    finally:
        os.close(out)
        writer.join(PATIENCE_S)


def test_movements_of_a_stream_are_judged_once_even_if_sent_again(history: History) -> None:
    first = rows(1.0, movements=3)
    assert watch_stream(first, history).judged == 3
    assert watch_stream(first, history).judged == 0  # all rows again
    assert watch_stream(rows(1.0, movements=5), history).judged == 2  # with further rows of the flight
    assert watch_stream(rows(2.0, movements=1), history).judged == 1
    assert watch_stream(first, history).judged == 0
    names = [kept.recording for kept in history.unit("S1").diagnoses()]
    assert len(names) == 6
    assert names[0].startswith("S1 at 1 h, 0.000 to 3.")


def test_a_stream_interrupted_anywhere_and_sent_again_is_judged_once(history: History) -> None:
    lines = rows(1.0, movements=3)
    for stop in range(150, len(lines), 130):
        settled = lines[:stop]
        watch_stream(settled, history)
    watch_stream(lines, history)
    spans = [kept.recording.partition(", ")[2].split(" ") for kept in history.unit("S1").diagnoses()]
    ends = [(float(a), float(b)) for a, _, b, _ in spans]
    assert all(span[1] < next_span[0] for span, next_span in pairwise(ends)), ends


def test_rows_out_of_order_and_after_a_clock_reset_are_judged(history: History) -> None:
    lines = rows(1.0, start=100.0, movements=2)
    lines[50], lines[60] = lines[60], lines[50]
    assert watch_stream(lines + rows(1.0, start=20.0, movements=2), history).judged == 4
    (event,) = history.events(kinds=["rows_skipped"])
    assert "clock was set back" in event.message


def test_interleaved_units_of_a_stream_are_separated(history: History) -> None:
    first, second = rows(1.0, movements=2), rows(5.0, unit="S2", movements=2)
    mixed = [line for pair in zip(first, second, strict=True) for line in pair]
    assert watch_stream(mixed, history).judged == 4
    assert judged_recordings(history) == [("S1", 1.0)] * 2 + [("S2", 5.0)] * 2


FEW_UNITS = replace(FAST, stream=replace(FAST.stream, most_units=3))


def test_rows_of_units_beyond_the_largest_number_at_once_are_left_out_and_reported(history: History) -> None:
    most = FEW_UNITS.stream.most_units
    rows_of_units = [rows(1.0, unit=f"S{number}", fault=0.01 * number) for number in range(most + 2)]
    mixed = [line for lines in zip(*rows_of_units, strict=True) for line in lines]
    assert watch_stream(mixed, history, settings=FEW_UNITS).judged == most
    assert len(judged_recordings(history)) == most
    left_out = [event.details for event in history.events(kinds=["rows_skipped"])]
    # All rows of two units, except the first row of each, which shows that there are too many units.
    assert (
        sum(details[f"of more than {most} units at once"] for details in left_out)
        == 2 * len(rows_of_units[0]) - 2
    )


def test_any_number_of_consecutive_units_is_judged(history: History) -> None:
    most = FEW_UNITS.stream.most_units
    rows_of_units = [rows(1.0, unit=f"S{number}", fault=0.01 * number) for number in range(most + 2)]
    mixed = [line for lines in rows_of_units for line in lines]
    assert watch_stream(mixed, history, settings=FEW_UNITS).judged == most + 2
    assert not history.events(kinds=["rows_skipped"])


def relabelled(lines: list[str], first: int, **labels: float) -> list[str]:
    """Return the rows, with other labels from row `first` on."""
    return [*lines[:first], *(json.dumps(json.loads(line) | labels) + "\n" for line in lines[first:])]


def test_new_hours_within_a_movement_end_it_and_its_remaining_rows_are_not_judged(history: History) -> None:
    lines = rows(1.0, movements=3)
    assert watch_stream(relabelled(lines, 600, hours=1.1), history).judged == 3
    spans = [kept.recording.partition(" at ")[2] for kept in history.unit("S1").diagnoses()]
    assert spans == ["1 h, 0.000 to 3.500 s", "1 h, 3.510 to 5.990 s", "1.1 h, 7.500 to 11.500 s"]
    # One event or two: rows left out so far are reported at once, later ones at the end.
    skipped = [event.details for event in history.events(kinds=["rows_skipped"])]
    assert {reason for details in skipped for reason in details} == {
        "in a movement whose beginning is not known"
    }
    # From 6 s to 7.5 s, when the command has rested for 1 s.
    assert sum(sum(details.values()) for details in skipped) == 150
    assert watch_stream(relabelled(rows(2.0, movements=2), 400, hours=2.1), history).judged == 2


def test_new_cycles_within_a_movement_do_not_end_it(history: History) -> None:
    lines = relabelled(relabelled(rows(1.0, movements=3), 0, cycles=100), 600, cycles=101)
    result = watch_stream(lines, history)
    assert (result.judged, result.refused) == (3, 0)
    (flight,) = history.unit("S1").flights()
    assert flight.cycles == 100


def test_the_remaining_rows_of_a_partly_judged_movement_are_not_judged(history: History) -> None:
    lines = rows(1.0, movements=2)
    assert watch_stream(lines[:200], history).judged == 1
    assert watch_stream(lines, history).judged == 1
    spans = [kept.recording.partition(", ")[2] for kept in history.unit("S1").diagnoses()]
    assert spans == ["0.000 to 1.990 s", "3.500 to 7.500 s"]


def test_invalid_rows_of_a_stream_are_counted(history: History) -> None:
    lines = rows(1.0)
    invalid = [
        "nonsense\n",
        '{"unit": "S1", "hours": 1.0, "time_s": 9}\n',
        '{"time_s": 9, "command_rad": 0}\n',
        '{"unit": "S1", "hours": 1.0, "time_s": 9, "command_rad": Infinity}\n',
    ]
    result = watch_stream(lines[:100] + invalid + lines[100:], history)
    assert (result.judged, result.rows_left_out) == (1, 4)
    # One event or two: rows left out so far are reported at once, later ones at the end.
    events = history.events()
    assert {event.kind for event in events} == {"rows_skipped"}
    assert sum(sum(event.details.values()) for event in events) == 4


def test_rows_without_hours_are_left_out_with_a_remedy(history: History) -> None:
    lines = [{name: v for name, v in json.loads(line).items() if name != "hours"} for line in rows(1.0)]
    result = watch_stream([json.dumps(line) + "\n" for line in lines], history)
    assert result.judged == 0
    assert f"0 refused, {len(lines)} rows left out; 0 prognoses" in str(result)
    (event,) = history.events()
    assert event.message == (
        f"{len(lines)} rows were left out: their hours are not known; give --hours or a column 'hours'"
    )


def test_a_csv_stream_is_judged_with_unit_and_hours_from_the_options(history: History) -> None:
    lines = [json.loads(line) for line in rows(1.0)]
    names = ("time_s", "command_rad", "current_A")
    text = [",".join(names) + "\n", *(",".join(str(row[name]) for name in names) + "\n" for row in lines)]
    assert watch_stream(text, history, ownership=Ownership(THESIS.name, "S9", 3.0)).judged == 1
    assert judged_recordings(history) == [("S9", 3.0)]


def test_back_pressure_holds_back_a_sender_that_is_too_fast(
    history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    sources, begin = list[StreamSource](), StreamSource.__post_init__

    def record_source(self: StreamSource) -> None:
        begin(self)
        sources.append(self)

    def slow(recording: Recording, actuator: Any, *, seed: int) -> Any:
        if len(history.units()) == 0:  # the first diagnosis lasts until the queue is full
            wait_for(lambda: sources[0].is_held_back)
        return stand_in.diagnosed(recording, actuator, seed=seed)

    monkeypatch.setattr(StreamSource, "__post_init__", record_source)
    most = QUICK.stream.queue + 4
    assert watch_stream(rows(1.0, movements=most), history, diagnose=slow).judged == most
    kinds = [(event.kind, event.state) for event in history.events()]
    # Raised and cleared once, or repeatedly if the reading was slow in between.
    assert kinds
    assert kinds == [("back_pressure", "raised"), ("back_pressure", "cleared")] * (len(kinds) // 2)


def test_described_foreign_columns_of_a_stream_are_converted(history: History) -> None:
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
    recordings: list[Recording] = []

    def diagnose(recording: Recording, actuator: Any, *, seed: int) -> Any:
        recordings.append(recording)
        return stand_in.diagnosed(recording, actuator, seed=seed)

    watch_task = task(out, ownership=Ownership(THESIS.name, "S9", 3.0), name="pipe", diagnose=diagnose)
    assert watch(watch_task, history, described, settings=FAST).judged == 1
    assert recordings[0].interval_s == pytest.approx(0.01)
    assert np.ptp(recordings[0]["command_rad"]) == pytest.approx(0.01, rel=0.01)
    os.close(out)


def test_a_watcher_continues_after_a_full_disk(inbox: Path, history: History) -> None:
    write_recordings(inbox, *range(8, 28))
    messages: list[str] = []
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    # Python ignores the signal, and writing beyond the limit fails as on a full disk.
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, limits[1]))
    try:
        with running(task(inbox, once=False), history, messages, WRITTEN):
            wait_for(lambda: messages)
            assert "free space there" in messages[0]
            before = judged_recordings(history)
            assert before
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
            wait_for(lambda: count_diagnoses(history) == 20)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert set(before) <= set(judged_recordings(history))
    assert len(set(judged_recordings(history))) == 20
    assert "can be used again" in messages[-1]


def test_a_failing_webhook_is_tried_only_with_pauses(inbox: Path, history: History) -> None:
    write_recordings(inbox, *range(22, 26))
    with webhook() as hook:
        hook.status = lambda: 503
        settings = replace(WRITTEN, delivery=replace(FAST.delivery, last_s=0.2))
        watch(task(inbox, webhook=hook.url), history, THESIS, settings=settings)
        assert 1 <= hook.attempts < 8
