"""The prognosis of each unit is kept up to date, one for all of its new diagnoses."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from emaphm.history import Finding, History
from emaphm.monitoring.outlook import Outlook
from emaphm.monitoring.settings import WATCH
from emaphm.prognosis import Evidence, Question, prognose

from .stand_in import THESIS, fly


@pytest.fixture
def history(tmp_path: Path) -> Iterator[History]:
    with History.open(tmp_path / "history.sqlite", create=True) as opened:
        yield opened


def test_it_is_that_of_the_verb_and_one_for_all_diagnoses(history: History) -> None:
    outlook = Outlook(history, WATCH.prognosis)
    fly(history, [0.0, 0.02, 0.04])
    for _ in range(3):
        outlook.ask("S1")
    assert outlook.waiting == 1
    assert outlook.step() is None
    assert (outlook.waiting, outlook.step()) == (0, None)
    kept = history.prognoses()["S1"]
    alone = prognose(Evidence.of(history.unit("S1")), THESIS, Question(200.0))
    assert kept.document["rul_hours"] == alone.to_dict()["rul_hours"]
    assert (kept.diagnoses, kept.hours) == (3, 40.0)
    assert not history.events()  # three diagnoses: the prior decides


def test_a_life_that_ends_is_raised_once_and_cleared_by_a_replacement(history: History) -> None:
    outlook = Outlook(history, replace(WATCH.prognosis, risk=0.3))
    fly(history, [0.1 + 0.08 * i for i in range(7)])
    for _ in range(2):
        outlook.ask("S1")
        outlook.step()
    (event,) = history.events()
    assert (event.kind, event.state, event.recording) == ("rul_below_horizon", "raised", "120.csv")
    assert event.details["component"] == "friction"
    assert event.details["probability_of_failure"] > 0.3
    history.add_finding("S1", Finding(120.0, "friction", "degraded", replaced=True))
    fly(history, [0.0] * 10, first=140.0)
    outlook.ask("S1")
    outlook.step()
    assert [one.state for one in history.events()] == ["raised", "cleared"]


def test_what_was_due_when_the_watcher_ended_is_due_again(history: History) -> None:
    outlook = Outlook(history, WATCH.prognosis)
    fly(history, [0.0])
    outlook.ask("S1")
    outlook.step()
    assert Outlook(history, WATCH.prognosis).waiting == 0
    fly(history, [0.0], first=20.0)
    assert Outlook(history, WATCH.prognosis).waiting == 1
