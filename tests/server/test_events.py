"""Events of uploads and of the server's prognoses, against those of `emaphm watch`."""

import time
from collections.abc import Iterable
from dataclasses import replace
from multiprocessing.connection import Pipe
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from emaphm.actuator import Actuator
from emaphm.history import Event, History
from emaphm.monitoring import WATCH, Ownership, WatchTask, watch
from emaphm.monitoring.outlook import Outlook
from emaphm.monitoring.receivers import Webhook
from emaphm.server import pages
from emaphm.server.folders import ServerFolder
from emaphm.server.run import running
from emaphm.server.settings import SETTINGS
from emaphm.server.work import worker
from emaphm.server.work.queue import DONE
from emaphm.server.work.worker import SERVER, Forecast, JobOutcome, Place, Upload
from monitoring import stand_in
from monitoring.hooks import webhook

from .conftest import SMALL, client_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

    from starlette.testclient import TestClient

    from emaphm.server.state import ServerState

THESIS = Actuator.thesis()

NUMBERS = range(22, 28)
"""Numbers of the recordings: three with a fault, then three healthy ones."""

SEED = 2
"""Seed of the server and of the watcher, different from the default."""

WRITTEN = replace(stand_in.QUICK, folder=replace(stand_in.QUICK.folder, poll_s=0.05, settle_s=0.0))
"""Settings for files that are complete before the watcher starts."""


@pytest.fixture
def arrived(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, no_prognoses: None) -> Path:  # noqa: ARG001
    """Return a folder of recordings; the diagnosis is a stand-in, there are no reports and no prognoses."""
    monkeypatch.setattr("emaphm.diagnosis.diagnose", _diagnose)
    monkeypatch.setattr(worker, "_write_report", lambda *_: None)
    folder = tmp_path / "in"
    folder.mkdir()
    for number in NUMBERS:
        (folder / stand_in.name(1, number)).write_text(stand_in.content(1, number))
    return folder


def _diagnose(recording: object, actuator: Actuator, *, seed: int, **_: object) -> object:
    return stand_in.diagnosed(recording, actuator, seed=seed)  # type: ignore[arg-type]


def watched(folder: Path, where: Path) -> tuple[Event, ...]:
    with History.open(where, create=True) as history:
        ownership = Ownership(THESIS.name, pattern=stand_in.PATTERN)
        task = WatchTask(folder, ownership, cut=None, takes_new_units=True, once=True, seed=SEED)
        watch(task, history, THESIS, settings=WRITTEN)
        return history.events()


def uploaded(folder: Path, where: Path, numbers: Iterable[int] = NUMBERS) -> list[JobOutcome]:
    with History.open(where, create=True):
        pass
    place = Place(str(where), ServerFolder(folder), {THESIS.name: THESIS}, 2**33, 2**26, seed=SEED)
    _, orders = Pipe()
    outcomes = []
    for number in numbers:
        path = folder / stand_in.name(1, number)
        request = {"unit": "U01", "hours": round(number * stand_in.FLIGHT_H, 2), "part": "", "cycles": None}
        request |= {"position": None, "late": False, "actuator": THESIS.name}
        outcomes.append(worker._outcome(Upload(path, path.name, request), place, orders))
    return outcomes


def known(events: tuple[Event, ...]) -> list[tuple[object, ...]]:
    return [
        (event.kind, event.state, event.severity, event.subject, event.recording_hash) for event in events
    ]


def test_uploads_give_the_same_events_as_watching(arrived: Path, tmp_path: Path) -> None:
    where = tmp_path / "uploads.sqlite"
    outcomes = uploaded(arrived, where)
    assert {outcome.state for outcome in outcomes} == {DONE}
    with History.open(where) as history:
        events = history.events()
        assert {kept.document["seed"] for kept in history.unit("U01").diagnoses()} == {SEED}
    assert known(events) == known(watched(arrived, tmp_path / "watched.sqlite"))
    assert {event.kind for event in events} == {"health_changed", "alarm"}
    assert {event.watcher for event in events} == {SERVER}
    messages = [message for outcome in outcomes for message in outcome.result["events"]]
    assert messages == [event.message for event in events]

    again = uploaded(
        arrived, where, NUMBERS[::3]
    )  # as jobs that were killed after their recordings were added
    assert {outcome.message for outcome in again} == {"is in the history already"}
    assert len(watched(arrived, where)) == len(events)  # a watcher does not repeat the events either


def test_the_message_of_a_refused_upload_names_the_fields_to_correct(arrived: Path, tmp_path: Path) -> None:
    where = tmp_path / "uploads.sqlite"
    uploaded(arrived, where, [23])
    (outcome,) = uploaded(arrived, where, [22])  # of earlier hours
    message = outcome.message
    assert message.endswith("check 'hours', or give 'late' for an old recording that is added late")


def test_events_of_the_server_are_sent_to_a_webhook(
    arrived: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_long_pause = replace(WATCH, delivery=replace(WATCH.delivery, first_pause_s=0.1))
    monkeypatch.setattr("emaphm.server.run.WATCH", without_long_pause)
    where = tmp_path / "uploads.sqlite"
    with History.open(where, create=True) as history:
        history.add_events(
            Event("alarm", "raised", "alarm", "before", "jam", "S9", watcher=SERVER),
            Event("alarm", "raised", "alarm", "of a watcher", "jam", "S8", watcher="in"),
        )

    def serving(url: str) -> "AbstractContextManager[ServerState]":
        receiver = Webhook(url, 5.0)
        return running(str(where), None, None, {}, replace(SETTINGS, workers=0), receiver=receiver)

    with webhook() as hook:
        statuses = iter([503])
        hook.status = lambda: next(statuses, 200)
        with serving(hook.url) as state:
            uploaded(arrived, where)
            state.pool._on_news()  # as after a job
            wait_for(lambda: len(hook.events) == 4)  # sent again after a pause
        uploaded(arrived, where)
        with serving(hook.url):
            pass
    with History.open(where) as history:
        events = [event.to_dict() for event in history.events()]
    assert hook.events == [event for event in events if event["message"] not in {"before", "of a watcher"}]
    assert hook.attempts == 5


@pytest.mark.usefixtures("warm_workers")
def test_the_end_of_a_job_triggers_the_delivery_of_events(fleet: Path) -> None:
    news = []
    with running(str(fleet), None, None, {"thesis": THESIS}, SMALL) as state:
        state.pool._on_news = lambda: news.append(1)
        content = b"time_s,command_rad\n0,0\n"
        client_of(state).post(
            "/api/v1/recordings",
            files={"recording": ("a.csv", content)},
            data={"unit": "SN-0001", "hours": "900"},
        )
        wait_for(lambda: bool(news))


def wait_for(condition: "Callable[[], bool]") -> None:
    deadline = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.evidence
@pytest.mark.usefixtures("few_paths")
def test_a_watcher_and_the_server_give_the_same_rul_event_and_prognosis(tmp_path: Path) -> None:
    results = []
    for name in ("watched", "served"):
        where = tmp_path / f"{name}.sqlite"
        with History.open(where, create=True) as history:
            for unit, rate in (("S1", 0.12), ("S2", 0.02), ("S3", 0.1)):
                stand_in.fly(history, [0.1 + rate * i for i in range(6)], unit=unit)
            if name == "watched":
                outlook = Outlook(history, WATCH.prognosis, seed=SEED, watcher="in")
                outlook.ask("S1")
                assert outlook.step()
            else:
                place = Place(str(where), ServerFolder(tmp_path), {}, 2**33, 2**26, seed=SEED)
                assert worker._outcome(Forecast("S1"), place, Pipe()[1]).state == DONE
            (event,) = history.events()
            results.append((event.message, event.details, history.prognoses()["S1"].document))
    assert results[0] == results[1]
    assert results[0][1]["fleet_units"] == 2
    assert results[0][2]["seed"] == SEED


@pytest.mark.usefixtures("few_steps", "undrawn_prognosis")
def test_a_prognosis_of_the_server_gives_the_event_of_a_short_rul(tmp_path: Path) -> None:
    with History.open(tmp_path / "history.sqlite", create=True) as history:
        stand_in.fly(history, [0.1 + 0.12 * i for i in range(6)])
        place = Place(str(tmp_path / "history.sqlite"), ServerFolder(tmp_path), {}, 2**33, 2**26)
        assert worker._outcome(Forecast("S1"), place, Pipe()[1]).state == DONE
        (event,) = history.events()
    assert (event.kind, event.state, event.watcher) == ("rul_below_horizon", "raised", SERVER)
    assert event.details["horizon_hours"] == WATCH.prognosis.horizon
    risk = event.details["probability_of_failure"]
    assert risk > 0.97  # 0.99 by all paths, with a standard error of 0.006 by a quarter of them
    assert f"within 200 h is {100 * risk:.1f} %, by friction" in event.message


def test_the_page_of_events_shows_the_events_of_the_fleet(client: "TestClient", state: "ServerState") -> None:
    assert "friction is degraded" in client.get("/events").text
    assert "friction is degraded" not in client.get("/events?kind=sensor_fault").text
    assert "<b>1</b> with an alarm" in client.get("/").text
    state.history.add_events(Event("alarm", "cleared", "info", "healthy", "friction", "SN-0001", 200.0))
    assert "<b>0</b> with an alarm" in client.get("/").text
    assert not client.get("/api/v1/events?only_open=true").json()["events"]


def test_a_long_list_of_events_is_divided_into_pages(
    client: "TestClient", state: "ServerState", monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pages, "MOST_LISTED", 2)
    state.history.add_events(*(Event("refused", "raised", "warning", "no", f"{n}.csv") for n in range(3)))
    first = client.get("/events?kind=refused").text
    assert "<caption>The newest 2 of 3 events.</caption>" in first
    assert '<a rel="next" href="/events?kind=refused&amp;page=2#all">' in first
    assert "<caption>3 to 3 of 3 events, counted" in client.get("/events?kind=refused&page=2").text
