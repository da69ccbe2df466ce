"""The prognosis of each unit is kept up to date, one for all of its new diagnoses."""

import time
from dataclasses import replace
from datetime import timedelta

import pytest

from emaphm.actuator.requirements import Requirement
from emaphm.errors import HistoryFormError, HistoryUnavailableError, PrognosisError
from emaphm.history import Finding, History, Mistake
from emaphm.history.storage.schema import VERSION
from emaphm.monitoring.outlook import NoPrognosisError, Outlook
from emaphm.monitoring.settings import WATCH
from emaphm.prognosis import Evidence, learnt_prior, prognose
from emaphm.prognosis.keeping import update_prognosis

from .stand_in import ROOMY, THESIS, fly

pytestmark = pytest.mark.usefixtures("few_steps")


def test_it_is_that_of_the_verb_and_one_for_all_diagnoses(history: History) -> None:
    outlook = Outlook(history, WATCH.prognosis)
    fly(history, [0.0, 0.02, 0.04])
    for _ in range(3):
        outlook.ask("S1")
    assert outlook.waiting == 1
    assert outlook.step()
    assert (outlook.waiting, outlook.step()) == (0, False)
    kept = history.prognoses()["S1"]
    asked = prognose(Evidence.of(history.unit("S1")), THESIS)
    assert kept.document["rul_hours"] == asked.to_dict()["rul_hours"]
    assert (kept.diagnoses, kept.hours) == (3, 40.0)
    assert not history.events()  # three diagnoses: the prior decides


def test_a_life_that_ends_is_raised_once_and_cleared_by_a_replacement(history: History) -> None:
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
    assert [one.state for one in history.events()] == ["raised", "cleared"]


def test_forecasts_from_a_recording_that_was_withdrawn_are_made_again(history: History) -> None:
    fly(history, [0.0, 0.02, 0.95])
    (*kept, wrong) = update_prognosis(history, history.unit("S1")).curves.fan
    history.withdraw("S1", Mistake("recording", 40.0, "another unit's"))
    fly(history, [0.06], first=60.0)
    (*again, _) = update_prognosis(history, history.unit("S1")).curves.fan
    assert wrong[0] == 40.0
    assert [row[0] for row in again] == [row[0] for row in kept] == [0.0, 20.0]


def test_forecasts_against_other_requirements_are_made_again(history: History) -> None:
    fly(history, [0.0, 0.1, 0.2])
    before = update_prognosis(history, history.unit("S1")).curves.fan
    tight = Requirement(component="friction", at_most=0.5)
    fly(history, [0.3], first=60.0, actuator=THESIS.model_copy(update={"requirements": (tight,)}))
    after = update_prognosis(history, history.unit("S1")).curves.fan
    assert [row[0] for row in after] == [0.0, 20.0, 40.0, 60.0]
    # The median at 40 h.
    assert after[2][3] < 0.7 * before[2][3]
    # Against the same ones they are those that were kept.
    fly(history, [0.4], first=80.0, actuator=THESIS.model_copy(update={"requirements": (tight,)}))
    assert update_prognosis(history, history.unit("S1")).curves.fan[:-1] == after


def test_none_is_kept_in_a_history_that_a_newer_version_has_changed_meanwhile(history: History) -> None:
    fly(history, [0.0])
    with history.database.writing() as connection:
        connection.execute(VERSION.update().values(version_num="0099"))
    with pytest.raises(HistoryFormError, match="update emaphm"):
        update_prognosis(history, history.unit("S1"))
    assert not history.prognoses()


def test_what_was_due_when_the_watcher_ended_is_due_again(history: History) -> None:
    outlook = Outlook(history, WATCH.prognosis)
    fly(history, [0.0])
    outlook.ask("S1")
    outlook.step()
    assert Outlook(history, WATCH.prognosis).waiting == 0
    fly(history, [0.0], first=20.0)
    assert Outlook(history, WATCH.prognosis).waiting == 1


def test_a_finding_makes_it_due_at_the_next_start(history: History) -> None:
    fly(history, [0.0])
    made = Outlook(history, WATCH.prognosis)
    made.step()
    assert Outlook(history, WATCH.prognosis).waiting == 0
    history.add_finding("S1", Finding(0.0, "friction", "degraded", replaced=True))
    again = Outlook(history, WATCH.prognosis)
    assert again.waiting == 1
    assert again.step()
    assert Outlook(history, WATCH.prognosis).waiting == 0


def test_a_first_prognosis_that_was_not_made_is_due_again_where_the_recording_is_new(
    history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    fly(history, [0.0])  # and the watcher is killed
    assert Outlook(history, WATCH.prognosis).waiting == 1
    monkeypatch.setattr("emaphm.monitoring.outlook.RECENT", timedelta(seconds=-10))  # filled long before
    assert Outlook(history, WATCH.prognosis).waiting == 0


def test_the_other_units_teach_it(history: History) -> None:
    for serial in ("S1", "S2"):
        fly(history, [0.1 + 0.05 * i for i in range(3)], unit=serial)
    outlook = Outlook(history, replace(WATCH.prognosis, fewest=3, risk=0.01))
    outlook.ask("S1")
    outlook.step()
    unit = history.unit("S1")
    asked = prognose(Evidence.of(unit), THESIS, prior=learnt_prior(history, unit))
    kept = history.prognoses()["S1"].document
    assert kept["rul_hours"] == asked.to_dict()["rul_hours"]
    (event,) = history.events()
    assert event.details["fleet_units"] == 1


def test_the_latest_diagnoses_are_used_and_all_are_counted(history: History) -> None:
    fly(history, [0.0] * 3)
    outlook = Outlook(history, replace(WATCH.prognosis, most=2))
    outlook.ask("S1")
    outlook.step()
    assert history.prognoses()["S1"].diagnoses == 3
    assert Outlook(history, WATCH.prognosis).waiting == 0


@pytest.mark.usefixtures("warm_workers")
def test_one_in_a_process_of_its_own_is_not_waited_for(history: History) -> None:
    fly(history, [0.0])
    outlook = Outlook(history, WATCH.prognosis, isolation=ROOMY)
    outlook.ask("S1")
    assert (outlook.step(), outlook.waiting) == (False, 1)
    assert not history.prognoses()
    outlook.ask("S1")  # a diagnosis that may have come too late for it
    deadline = time.monotonic() + 60.0
    while not outlook.step():
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert "S1" in history.prognoses()
    assert (outlook.waiting, outlook.step(), outlook.waiting) == (1, False, 1)
    began = time.monotonic()
    outlook.close()  # with another one under way
    assert time.monotonic() - began < 5.0


@pytest.mark.parametrize(
    ("error", "raised", "waiting"),
    [
        (PrognosisError("it is not finite"), NoPrognosisError, 0),
        (HistoryUnavailableError("the disk is full"), HistoryUnavailableError, 1),
    ],
)
def test_one_that_cannot_be_made_is_said_and_one_that_cannot_be_kept_stays_due(
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
