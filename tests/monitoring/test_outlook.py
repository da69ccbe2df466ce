"""The watcher's prognoses of units are up to date, with one prognosis for all new diagnoses of a unit."""

import time
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest

from emaphm.actuator.requirements import Requirement
from emaphm.errors import HistoryError, HistoryFormError, HistoryUnavailableError, PrognosisError
from emaphm.history import Finding, History, Mistake
from emaphm.history.storage.schema import VERSION
from emaphm.monitoring.outlook import NoPrognosisError, Outlook
from emaphm.monitoring.settings import WATCH
from emaphm.prognosis import Evidence, learnt_prior, prognose
from emaphm.prognosis.keeping import update_prognosis

from .stand_in import ROOMY, THESIS, fly
from .test_watch import watch_once, write_recordings

pytestmark = pytest.mark.usefixtures("few_steps")


def test_one_prognosis_is_made_for_all_new_diagnoses_and_equals_that_of_the_command(history: History) -> None:
    outlook = Outlook(history, WATCH.prognosis)
    fly(history, [0.0, 0.02, 0.04])
    for _ in range(3):
        outlook.ask("S1")
    assert outlook.waiting == 1
    assert outlook.step()
    assert (outlook.waiting, outlook.step()) == (0, False)
    kept = history.prognoses()["S1"]
    expected = prognose(Evidence.of(history.unit("S1")), THESIS)
    assert kept.document["rul_hours"] == expected.to_dict()["rul_hours"]
    assert (kept.diagnoses, kept.hours) == (3, 40.0)
    assert not history.events()  # with three diagnoses, the prior dominates


def test_a_short_rul_raises_one_event_which_a_replacement_clears(history: History) -> None:
    outlook = Outlook(history, replace(WATCH.prognosis, risk=0.3))
    fly(history, [0.1 + 0.12 * i for i in range(5)])
    for _ in range(2):
        outlook.ask("S1")
        outlook.step()
    (event,) = history.events()
    assert (event.kind, event.state, event.recording) == ("rul_below_horizon", "raised", "80.csv")
    assert event.details["component"] == "friction"
    assert event.details["probability_of_failure"] > 0.3
    history.add_finding("S1", Finding(80.0, "friction", "degraded", replaced=True))
    fly(history, [0.0] * 6, first=100.0)
    outlook.ask("S1")
    outlook.step()
    assert [event.state for event in history.events()] == ["raised", "cleared"]


def test_past_forecasts_from_a_withdrawn_recording_are_computed_again(history: History) -> None:
    fly(history, [0.0, 0.02, 0.95])
    (*kept, wrong) = update_prognosis(history, history.unit("S1")).fan
    history.withdraw("S1", Mistake("recording", 40.0, "another unit's"))
    fly(history, [0.06], first=60.0)
    (*again, _) = update_prognosis(history, history.unit("S1")).fan
    assert wrong[0] == 40.0
    assert [row[0] for row in again] == [row[0] for row in kept] == [0.0, 20.0]


def test_a_prognosis_of_a_unit_that_was_withdrawn_meanwhile_is_not_stored_for_another_unit(
    history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    def moved(*values: Any, real: Any = prognose, **options: Any) -> Any:
        made = real(*values, **options)
        history.withdraw("S1", Mistake("recording", 0.0, "of S2"))
        fly(history, [0.0], unit="S2")
        return made

    fly(history, [0.0])
    monkeypatch.setattr("emaphm.prognosis.keeping.update.prognose", moved)
    with pytest.raises(HistoryError, match="no unit 'S1'"):
        update_prognosis(history, history.unit("S1"))
    assert not history.prognoses()


def test_past_forecasts_are_computed_again_after_a_change_of_requirements(history: History) -> None:
    fly(history, [0.0, 0.1, 0.2])
    before = update_prognosis(history, history.unit("S1")).fan
    tight = Requirement(component="friction", at_most=0.5)
    fly(history, [0.3], first=60.0, actuator=THESIS.model_copy(update={"requirements": (tight,)}))
    after = update_prognosis(history, history.unit("S1")).fan
    assert [row[0] for row in after] == [0.0, 20.0, 40.0, 60.0]
    # The median at 40 h.
    assert after[2][3] < 0.7 * before[2][3]
    # With the same requirements, the stored forecasts are used.
    fly(history, [0.4], first=80.0, actuator=THESIS.model_copy(update={"requirements": (tight,)}))
    assert update_prognosis(history, history.unit("S1")).fan[:-1] == after


def test_no_prognosis_is_stored_in_a_history_migrated_by_a_newer_version(history: History) -> None:
    fly(history, [0.0])
    with history.database.writing() as connection:
        connection.execute(VERSION.update().values(version_num="0099"))
    with pytest.raises(HistoryFormError, match="update emaphm"):
        update_prognosis(history, history.unit("S1"))
    assert not history.prognoses()


def test_a_prognosis_that_was_due_at_the_end_of_a_watcher_is_due_at_the_next_start(history: History) -> None:
    outlook = Outlook(history, WATCH.prognosis)
    fly(history, [0.0])
    outlook.ask("S1")
    outlook.step()
    assert Outlook(history, WATCH.prognosis).waiting == 0
    fly(history, [0.0], first=20.0)
    assert Outlook(history, WATCH.prognosis).waiting == 1


def test_a_finding_makes_the_prognosis_due_at_the_next_start(history: History) -> None:
    fly(history, [0.0])
    outlook = Outlook(history, WATCH.prognosis)
    outlook.step()
    assert Outlook(history, WATCH.prognosis).waiting == 0
    history.add_finding("S1", Finding(0.0, "friction", "degraded", replaced=True))
    again = Outlook(history, WATCH.prognosis)
    assert again.waiting == 1
    assert again.step()
    assert Outlook(history, WATCH.prognosis).waiting == 0


def test_a_missing_first_prognosis_is_due_at_the_next_start_only_for_a_new_recording(
    history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    fly(history, [0.0])  # and the watcher is killed
    assert Outlook(history, WATCH.prognosis).waiting == 1
    monkeypatch.setattr("emaphm.monitoring.outlook.RECENT", timedelta(seconds=-10))  # filled long before
    assert Outlook(history, WATCH.prognosis).waiting == 0


def test_the_prognosis_learns_from_other_units(history: History) -> None:
    for serial in ("S1", "S2"):
        fly(history, [0.1 + 0.05 * i for i in range(3)], unit=serial)
    outlook = Outlook(history, replace(WATCH.prognosis, fewest=3, risk=0.01))
    outlook.ask("S1")
    outlook.step()
    unit = history.unit("S1")
    expected = prognose(Evidence.of(unit), THESIS, prior=learnt_prior(history, unit))
    kept = history.prognoses()["S1"].document
    assert kept["rul_hours"] == expected.to_dict()["rul_hours"]
    (event,) = history.events()
    assert event.details["fleet_units"] == 1


def test_only_the_latest_diagnoses_are_used_but_all_are_counted(history: History) -> None:
    fly(history, [0.0] * 3)
    outlook = Outlook(history, replace(WATCH.prognosis, most=2))
    outlook.ask("S1")
    outlook.step()
    assert history.prognoses()["S1"].diagnoses == 3
    assert Outlook(history, WATCH.prognosis).waiting == 0


@pytest.mark.usefixtures("warm_workers")
def test_a_prognosis_in_a_separate_process_does_not_block_the_watcher(history: History) -> None:
    fly(history, [0.0])
    outlook = Outlook(history, WATCH.prognosis, isolation=ROOMY)
    outlook.ask("S1")
    assert (outlook.step(), outlook.waiting) == (False, 1)
    assert not history.prognoses()
    outlook.ask("S1")  # a diagnosis that may be too late for the running prognosis
    deadline = time.monotonic() + 60.0
    while not outlook.step():
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert "S1" in history.prognoses()
    assert (outlook.waiting, outlook.step(), outlook.waiting) == (1, False, 1)
    start = time.monotonic()
    outlook.close()  # while another prognosis is running
    assert time.monotonic() - start < 5.0


@pytest.mark.parametrize(
    ("error", "raised", "waiting"),
    [
        (PrognosisError("it is not finite"), NoPrognosisError, 0),
        (HistoryError("no unit 'S1' in the history"), NoPrognosisError, 0),
        (HistoryUnavailableError("the disk is full"), HistoryUnavailableError, 1),
    ],
)
def test_a_failed_prognosis_is_reported_and_one_that_cannot_be_stored_stays_due(
    history: History,
    monkeypatch: pytest.MonkeyPatch,
    error: Exception,
    raised: type[Exception],
    waiting: int,
) -> None:
    def failing(*_: object, **__: object) -> None:
        raise error

    fly(history, [0.0])
    monkeypatch.setattr("emaphm.monitoring.outlook.update_prognosis", failing)
    outlook = Outlook(history, WATCH.prognosis)
    outlook.ask("S1")
    with pytest.raises(raised, match=str(error)):
        outlook.step()
    assert outlook.waiting == waiting


@pytest.mark.parametrize("case", ["a defect", "the unit is withdrawn"])
def test_a_prognosis_that_fails_does_not_end_the_watcher(
    tmp_path: Path, history: History, monkeypatch: pytest.MonkeyPatch, case: str
) -> None:
    for unit in (1, 2):
        write_recordings(tmp_path, 0, unit=unit)

    def prognosed(history: History, unit: str, *_: Any) -> None:
        if unit == "U01" and case == "a defect":
            raise ZeroDivisionError
        if unit == "U01":
            history.withdraw(unit, Mistake("recording", 0.0, "another unit's"))
        history.unit(unit)

    monkeypatch.setattr("emaphm.monitoring.outlook.prognosed", prognosed)
    messages: list[str] = []
    result = watch_once(tmp_path, history, messages)
    assert (result.judged, result.prognoses) == (2, 1)
    reason = "ZeroDivisionError" if case == "a defect" else "no prognosis of 'U01': no unit 'U01'"
    assert any(reason in line for line in messages)
