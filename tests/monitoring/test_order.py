"""Hours that do not rise with the arrival of recordings: an alarm that they hide is not missing silently."""

from collections.abc import Sequence

import numpy as np
import pytest

from emaphm.history import Entry, Event, Finding, History, Removal
from emaphm.history.records import Mistake
from emaphm.monitoring.judging import Judge
from emaphm.monitoring.settings import WATCH
from emaphm.recording import Recording

from .stand_in import THESIS, diagnosed, diagnosis


def filed(history: History, hours: Sequence[float], friction: float = 0.0) -> list[Event]:
    """File recordings of unit S1 in this order as a watcher does, and return the events."""
    judge = Judge(history, THESIS, WATCH.alarm, diagnosed, None)
    found = []
    for one in hours:
        channels = ("time_s", "command_rad", "current_A")
        recording = Recording({name: np.arange(60.0) + one for name in channels}, source=f"{one:g}.csv")
        made = diagnosis(recording, THESIS, friction)
        found += judge.filed(Entry("S1", THESIS.name, one, late=True), recording, made, {})
    return found


def behind(found: Sequence[Event]) -> list[tuple[str, float | None]]:
    return [(one.state, one.hours) for one in found if one.kind == "hours_behind"]


def test_recordings_behind_one_of_wrong_hours_are_said_once(history: History) -> None:
    filed(history, [100.0, 20_000.0])
    found = filed(history, [200.0, 300.0, 400.0, 500.0], friction=0.5)
    assert behind(found) == [("raised", 400.0)]
    assert "a recording at 20000 h" in found[0].message
    assert found[0].recording == "400.csv"
    assert [one.kind for one in found] == ["hours_behind"]  # the alarms are what the wrong hours hide


def test_health_is_judged_again_when_the_wrong_one_is_taken_out(history: History) -> None:
    filed(history, [100.0, 20_000.0, 200.0, 300.0, 400.0])
    history.withdraw("S1", Mistake("recording", 20_000.0, "its name was mistyped"))
    found = filed(history, [500.0, 600.0, 700.0], friction=0.5)
    assert behind(found) == [("cleared", 500.0)]
    assert [one.hours for one in found if one.kind == "alarm"] == [700.0]


@pytest.mark.parametrize(
    ("add", "named"),
    [
        (
            lambda one: one.add_finding("S1", Finding(4e4, "friction", "degraded", replaced=True)),
            "finding on",
        ),
        (lambda one: one.add_removal("S1", Removal(4e4, "other")), "removal"),
    ],
    ids=["finding", "removal"],
)
def test_a_shops_entry_of_wrong_hours_is_named(history: History, add: object, named: str) -> None:
    filed(history, [100.0])
    assert callable(add)
    add(history)
    (raised,) = [one for one in filed(history, [200.0, 300.0, 400.0]) if one.kind == "hours_behind"]
    assert named in raised.message
    assert raised.details["latest_hours"] == 4e4


@pytest.mark.parametrize(
    "hours", [[1.0, 2.0, 3.0, 4.0, 5.0], [9.0, 7.0, 5.0, 3.0], [1.0, 4.0, 2.0, 3.0, 5.0, 8.0, 6.0, 7.0, 9.0]]
)
def test_old_recordings_that_arrive_in_another_order_are_no_contradiction(
    history: History, hours: list[float]
) -> None:
    assert not behind(filed(history, hours))
