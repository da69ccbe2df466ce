"""Events and prognoses in a history: stored once, in order, and selected by unit, kind and time."""

import os
import re
import sqlite3
import threading
from collections.abc import Callable
from dataclasses import replace

import pytest

from emaphm.errors import HistoryError
from emaphm.history import Event, Finding, History, KeptPrognosis, Mistake, Removal
from emaphm.history.basis import Basis
from emaphm.history.blocks import unit_blocks
from emaphm.history.storage.tables import PROGNOSES
from emaphm.history.views import marks

from .made_up import diagnosis, entry, recording


def event(
    unit: str | None = "S1",
    kind: str = "alarm",
    state: str = "raised",
    *,
    subject: str = "friction",
    recording_hash: str | None = "a1",
    at: str = "2026-03-01T10:00:00Z",
) -> Event:
    return Event(
        kind,
        state,
        "alarm",
        "a sentence",
        subject,
        unit,
        12.5,
        "1.csv",
        recording_hash,
        {"level": 0.3, "bound": float("inf")},
        "w1",
        at,
    )


def test_events_are_read_as_added_and_repeated_events_are_added_once(history: History) -> None:
    assert history.add_events(event(), event("S2")) == 2
    assert history.add_events(event(at="2026-03-02T10:00:00Z"), event("S2", "sensor_fault")) == 1
    kept = history.events()
    assert [(kept_event.unit, kept_event.kind) for kept_event in kept] == [
        ("S1", "alarm"),
        ("S2", "alarm"),
        ("S2", "sensor_fault"),
    ]
    assert [kept_event.number for kept_event in kept] == sorted(kept_event.number or 0 for kept_event in kept)
    values = kept[0].to_dict()
    assert values["id"] == event().key
    assert values["at"] == event().at
    assert values["details"] == {"level": 0.3, "bound": None}


def test_events_are_found_by_unit_kind_time_and_number(history: History) -> None:
    times = [f"2026-03-0{day}T10:00:00Z" for day in (1, 2, 3)]
    for number, at in enumerate(times):
        history.add_events(event(recording_hash=str(number), at=at), event("S2", recording_hash=str(number)))
    history.add_events(event(None, "source_lost", subject=""))
    assert [kept.at for kept in history.events(unit="S1")] == times
    assert [kept.at for kept in history.events(unit="S1", since=times[1], until=times[2])] == times[1:2]
    # The same times in another time zone and format; a day begins at midnight UTC.
    since, until = "2026-03-02T12:00:00+02:00", "2026-03-03T09:59:59.5Z"
    assert [kept.at for kept in history.events(unit="S1", since=since, until=until)] == times[1:2]
    assert [kept.at for kept in history.events(unit="S1", since="2026-03-02", until="2026-03-03")] == times[
        1:2
    ]
    assert [kept.kind for kept in history.events(kinds=["source_lost"])] == ["source_lost"]
    first, second = history.events(limit=2)
    assert history.events(after=first.number, limit=1) == (second,)
    assert history.events(newest_first=True, limit=1)[0].kind == "source_lost"


@pytest.mark.parametrize("time", ["yesterday", "0001-01-01T00:00:00+14:00", "9999-12-31T23:00-05:00"])
def test_invalid_times_are_refused(history: History, time: str) -> None:
    message = f"'{re.escape(time)}' is no time"
    with pytest.raises(HistoryError, match=message):
        history.events(since=time)
    with pytest.raises(HistoryError, match=message):
        history.events(until=time)


def test_a_condition_is_open_until_it_is_cleared(history: History) -> None:
    history.add_events(event(), event(subject="gain"), event("S2"), event(kind="health_changed"))
    history.add_events(event(state="cleared", recording_hash="a2"))
    assert [(condition.unit, condition.subject) for condition in history.open_conditions()] == [
        ("S1", "gain"),
        ("S2", "friction"),
    ]
    history.add_events(event(recording_hash="a3"))
    assert [condition.subject for condition in history.open_conditions("S1")] == ["gain", "friction"]


def test_processes_of_one_watcher_raise_a_condition_only_once(history: History) -> None:
    def pressure(state: str, minute: int, watcher: str = "w1") -> Event:
        message = f"{minute} recordings wait"
        at = f"2026-03-01T10:{minute:02}:00Z"
        return Event("back_pressure", state, "warning", message, "in", watcher=watcher, at=at)

    assert history.add_events(pressure("raised", 1)) == 1
    assert history.add_events(pressure("raised", 2)) == 0
    assert history.add_events(pressure("raised", 2, "w2")) == 1
    assert history.add_events(pressure("cleared", 3), pressure("cleared", 4)) == 1
    assert history.add_events(pressure("raised", 5)) == 1
    assert [(kept.state, kept.message[:1]) for kept in history.events() if kept.watcher == "w1"] == [
        ("raised", "1"),
        ("cleared", "3"),
        ("raised", "5"),
    ]


def test_a_condition_cleared_by_one_watcher_stays_open_for_another(history: History) -> None:
    for state, watcher, minute in (("raised", "w1", 1), ("raised", "w2", 2), ("cleared", "w1", 3)):
        at = f"2026-03-01T10:{minute:02}:00Z"
        history.add_events(Event("source_lost", state, "warning", state, "in", watcher=watcher, at=at))
    assert [condition.watcher for condition in history.open_conditions()] == ["w2"]


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(HistoryError, match="did you mean 'alarm'"):
        event(kind="allarm")


def test_texts_that_a_database_cannot_store_are_escaped(history: History) -> None:
    """A file name may not be valid UTF-8, and a text may contain NUL characters."""
    name = os.fsdecode(b"caf\xe9.csv")
    unencodable = Event("refused", "raised", "warning", f"{name}: no \0", name, recording=name, watcher=name)
    assert history.add_events(unencodable, unencodable) == 1
    (kept,) = history.events()
    assert (kept.subject, kept.message) == (r"caf\udce9.csv", r"caf\udce9.csv: no ")
    assert (kept.key, kept.condition) == (unencodable.key, unencodable.condition)


def test_events_of_concurrent_writers_are_all_stored_once(history: History) -> None:
    def write(number: int) -> None:
        for i in range(5):
            history.add_events(event(recording_hash=f"{number} {i}"), event(recording_hash=f"shared {i}"))

    threads = [threading.Thread(target=write, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(history.events()) == 4 * 5 + 5


def test_only_the_last_prognosis_of_a_unit_is_stored(history: History) -> None:
    with pytest.raises(HistoryError, match="S1"):
        history.keep_prognosis("S1", KeptPrognosis(10.0, {}, Basis(1, (0, 0, 0))))
    history.add(entry(), recording(1), diagnosis(1))
    for diagnoses in (1, 2):
        document = {"rul_hours": {"median": float("inf")}, "n": diagnoses}
        kept = KeptPrognosis(10.0 * diagnoses, document, Basis(diagnoses, (0, 0, 0)))
        history.keep_prognosis("S1", kept)
    (kept,) = history.prognoses().values()
    assert (kept.hours, kept.diagnoses) == (20.0, 2)
    assert kept.document == {"rul_hours": {"median": None}, "n": 2}


def _is_shown_as_current(history: History, basis: Basis) -> tuple[bool, bool]:
    """Return whether a prognosis of S1 with `basis` is current according to the unit's state and blocks."""
    kept = KeptPrognosis.of(basis, {"hours": 10.0, "probability_of_failure": 0.0})
    history.keep_prognosis("S1", kept)
    (state,) = history.states()
    blocks = unit_blocks(history.unit("S1"))["prognostic_assessment"]
    return history.prognoses()["S1"].is_current(state.basis), not blocks["out_of_date"]


@pytest.mark.parametrize(
    "enter",
    [
        lambda history: history.add(entry(), recording(1), replace(diagnosis(1), seed=7)),
        lambda history: history.add_removal("S1", Removal(10.0, "failed")),
        lambda history: history.add_finding("S1", Finding(10.0, "friction", "failed")),
        lambda history: history.withdraw("S1", Mistake("finding", 10.0, "another unit's")),
        lambda history: history.withdraw("S1", Mistake("recording", 10.0, "another unit's", "2.csv")),
    ],
    ids=["diagnosis", "removal", "finding", "finding withdrawn", "recording withdrawn"],
)
def test_an_entry_after_the_start_of_a_prognosis_makes_it_out_of_date_in_the_same_second(
    history: History, enter: Callable[[History], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("basis", "writing", "withdrawing"):
        monkeypatch.setattr(f"emaphm.history.{module}.timestamp", lambda: "2026-01-01T00:00:00Z")
    for number in (1, 2):
        history.add(entry(), recording(number), diagnosis(number))
    history.add_finding("S1", Finding(10.0, "backlash", "healthy"))
    begun = history.basis("S1")
    assert _is_shown_as_current(history, begun) == (True, True)
    enter(history)
    assert _is_shown_as_current(history, begun) == (False, False)
    assert _is_shown_as_current(history, history.basis("S1")) == (True, True)


def test_a_prognosis_stored_by_an_older_version_is_out_of_date(history: History) -> None:
    history.add(entry(), recording(1), diagnosis(1))
    _is_shown_as_current(history, history.basis("S1"))
    with history.writing() as connection:
        connection.execute(PROGNOSES.update().values(document='{"hours": 10.0}', at="2099-01-01T00:00:00Z"))
    (state,) = history.states()
    assert not history.prognoses()["S1"].is_current(state.basis)


def test_another_prognosis_from_the_same_diagnoses_changes_the_marks(history: History) -> None:
    history.add(entry(), recording(1), diagnosis(1))
    history.add(entry("S2"), recording(2), diagnosis(2))
    all_marks = set()
    # The last prognosis of S1 was begun before that of S2 and is stored after it.
    for unit, second in (("S1", 10), ("S2", 20), ("S1", 15)):
        history.keep_prognosis(
            unit, KeptPrognosis(10.0, {}, Basis(1, (0, 0, 0), f"2026-01-01T00:00:{second}Z"))
        )
        with history.database.reading() as connection:
            all_marks.add(marks(connection))
    assert len(all_marks) == 3


def test_a_history_file_can_be_read_during_a_write_transaction(tmp_path: object) -> None:
    with History.open(f"{tmp_path}/h.sqlite", create=True) as history:
        history.add_events(event())
        with history.database.writing():
            assert len(history.events()) == 1
        with sqlite3.connect(f"{tmp_path}/h.sqlite") as plain:
            assert plain.execute("SELECT kind, unit FROM events").fetchall() == [("alarm", "S1")]


def test_a_prognosis_from_more_diagnoses_gives_a_new_event(history: History) -> None:
    for state, diagnoses in (("raised", 5), ("raised", 5), ("cleared", 6), ("raised", 7)):
        made_from = {"diagnoses": diagnoses, "replacements": 0}
        history.add_events(
            replace(event(kind="rul_below_horizon", state=state), details={"made_from": made_from})
        )
    assert [kept.state for kept in history.events()] == ["raised", "cleared", "raised"]
    assert [kept.kind for kept in history.open_conditions("S1")] == ["rul_below_horizon"]
