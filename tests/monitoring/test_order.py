"""Recordings whose hours do not increase with their arrival, which can hide alarms, are reported."""

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
    """File recordings of unit S1 in this order, as a watcher does, and return the events."""
    judge = Judge(history, THESIS, WATCH.alarm, diagnosed, None)
    events = []
    for at_hours in hours:
        channels = ("time_s", "command_rad", "current_A")
        recording = Recording(
            {name: np.arange(60.0) + at_hours for name in channels}, source=f"{at_hours:g}.csv"
        )
        result = diagnosis(recording, THESIS, friction)
        events += judge.filed(Entry("S1", THESIS.name, at_hours, late=True), recording, result, {})
    return events


def behind(events: Sequence[Event]) -> list[tuple[str, float | None]]:
    return [(event.state, event.hours) for event in events if event.kind == "hours_behind"]


def test_recordings_before_one_with_wrong_hours_are_reported_once(history: History) -> None:
    filed(history, [100.0, 20_000.0])
    events = filed(history, [200.0, 300.0, 400.0, 500.0], friction=0.5)
    assert behind(events) == [("raised", 400.0)]
    assert "a recording at 20000 h" in events[0].message
    assert events[0].recording == "400.csv"
    assert [event.kind for event in events] == ["hours_behind"]  # the wrong hours hide the alarms


def test_health_is_judged_again_after_the_wrong_recording_is_withdrawn(history: History) -> None:
    filed(history, [100.0, 20_000.0, 200.0, 300.0, 400.0])
    history.withdraw("S1", Mistake("recording", 20_000.0, "its name was mistyped"))
    events = filed(history, [500.0, 600.0, 700.0], friction=0.5)
    assert behind(events) == [("cleared", 500.0)]
    assert [event.hours for event in events if event.kind == "alarm"] == [700.0]


@pytest.mark.parametrize(
    ("add", "named"),
    [
        (
            lambda event: event.add_finding("S1", Finding(4e4, "friction", "degraded", replaced=True)),
            "finding on",
        ),
        (lambda event: event.add_removal("S1", Removal(4e4, "other")), "removal"),
    ],
    ids=["finding", "removal"],
)
def test_a_shop_entry_with_wrong_hours_is_named(history: History, add: object, named: str) -> None:
    filed(history, [100.0])
    assert callable(add)
    add(history)
    (raised,) = [event for event in filed(history, [200.0, 300.0, 400.0]) if event.kind == "hours_behind"]
    assert named in raised.message
    assert raised.details["latest_hours"] == 4e4


@pytest.mark.parametrize(
    "hours", [[1.0, 2.0, 3.0, 4.0, 5.0], [9.0, 7.0, 5.0, 3.0], [1.0, 4.0, 2.0, 3.0, 5.0, 8.0, 6.0, 7.0, 9.0]]
)
def test_old_recordings_that_arrive_in_another_order_raise_no_condition(
    history: History, hours: list[float]
) -> None:
    assert not behind(filed(history, hours))
