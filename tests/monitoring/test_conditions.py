"""Conditions raised and cleared by diagnoses: alarms with hysteresis, and their false-alarm rate."""

import json
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from emaphm.diagnosis import Diagnosis
from emaphm.history import Entry, Event, Flight, History, KeptDiagnosis, KeptSettings, Replacement
from emaphm.history.storage.diagnosis_row import row_of
from emaphm.monitoring.conditions import Situation, health_events
from emaphm.monitoring.false_alarms import FalseAlarmRate
from emaphm.monitoring.judging import Judge
from emaphm.monitoring.settings import WATCH
from emaphm.recording import Recording

from .stand_in import THESIS, diagnosed, diagnosis

RECORDING = Recording({name: np.arange(60.0) for name in ("time_s", "command_rad", "current_A")})


def kept(hours: float, friction: float = 0.0, *, explained: bool = True, **document: object) -> KeptDiagnosis:
    row = row_of(replace(diagnosis(RECORDING, THESIS, friction), explained=explained))
    return KeptDiagnosis(
        Flight(hours, None, None),
        f"hash {hours}",
        f"{hours:g}.csv",
        np.frombuffer(row["vector"]),
        np.frombuffer(row["standard_errors"]),
        explained,
        tuple(json.loads(row["coordinates"])),
        np.eye(9),
        KeptSettings(""),
        "1",
        "2026-01-01T00:00:00Z",
        json.dumps(json.loads(row["document"]) | document),
    )


def run(
    diagnoses: Sequence[KeptDiagnosis], replacements: Sequence[Replacement] = ()
) -> list[tuple[float, Event]]:
    """Return the events of diagnoses that are evaluated one after the other, with their hours."""
    events: list[tuple[float, Event]] = []
    open_conditions: dict[tuple[str | None, str, str], Event] = {}
    for i in range(len(diagnoses)):
        past_replacements = [
            replacement for replacement in replacements if replacement.hours < diagnoses[i].hours
        ]
        situation = Situation(
            "S1",
            diagnoses[max(0, i - 29) : i + 1],
            list(open_conditions.values()),
            past_replacements,
            WATCH.alarm,
        )
        for event in health_events(situation):
            events.append((diagnoses[i].hours, event))
            if event.kind != "health_changed":
                open_conditions.pop(event.condition, None)
                if event.state == "raised":
                    open_conditions[event.condition] = event
    return events


def states_of(events: Sequence[tuple[float, Event]], kind: str = "alarm") -> list[tuple[float, str]]:
    return [(hours, event.state) for hours, event in events if event.kind == kind]


def levels(text: str) -> list[KeptDiagnosis]:
    """Return a diagnosis for each letter: healthy, degraded or unexplained."""
    makers = {"h": (0.0, True), "d": (0.5, True), "u": (0.5, False)}
    return [kept(float(i), makers[c][0], explained=makers[c][1]) for i, c in enumerate(text)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("hdhddh", []),
        ("hddd", [(3.0, "raised")]),
        ("ddd", [(2.0, "raised")]),
        ("dddddd", [(2.0, "raised")]),
        ("dddhhdhhd", [(2.0, "raised")]),
        ("dddhhh", [(2.0, "raised"), (5.0, "cleared")]),
        ("dddhhhddd", [(2.0, "raised"), (5.0, "cleared"), (8.0, "raised")]),
        ("dudud", [(4.0, "raised")]),
        ("uuuuuu", []),
    ],
)
def test_an_alarm_needs_several_consecutive_diagnoses(text: str, expected: list[tuple[float, str]]) -> None:
    assert states_of(run(levels(text))) == expected


def test_the_health_changes_with_each_decided_verdict() -> None:
    events = run(levels("hhduhd"))
    changes = [(hours, event.details["verdict"]) for hours, event in events if event.kind == "health_changed"]
    assert changes == [(2.0, "degraded"), (4.0, "healthy"), (5.0, "degraded")]


def test_a_replacement_clears_an_alarm_and_resets_its_count() -> None:
    events = run(levels("ddddhddhddd"), [Replacement(3.0, "friction")])
    assert states_of(events) == [(2.0, "raised"), (4.0, "cleared"), (10.0, "raised")]
    assert "replaced at 3 h" in next(event.message for _, event in events if event.state == "cleared")
    assert states_of(run(levels("dddd"), [Replacement(2.0, "gain")])) == [(2.0, "raised")]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("hddhh", [(1.0, "degraded"), (3.0, "healthy")]),
        ("hdddd", [(1.0, "degraded"), (3.0, "degraded")]),
        ("hhhhh", []),
        ("hhhdd", [(3.0, "degraded")]),
    ],
)
def test_health_after_a_replacement_is_reported_unless_it_was_healthy_before_and_after(
    text: str, expected: list[tuple[float, str]]
) -> None:
    events = run(levels(text), [Replacement(2.0, "friction")])
    changes = [(hours, event.details["verdict"]) for hours, event in events if event.kind == "health_changed"]
    assert changes == expected


def test_unexplained_diagnoses_raise_and_clear_a_condition_once() -> None:
    events = run(levels("huuhh"))
    assert states_of(events, "not_explained") == [(1.0, "raised"), (3.0, "cleared")]


def test_sensor_faults_are_conditions_per_channel() -> None:
    frozen = {"channel": "speed_rad_s", "kind": "frozen", "sentence": "The sensor is frozen."}
    events = run([kept(0.0), kept(1.0, sensor_faults=[frozen]), kept(2.0, sensor_faults=[frozen]), kept(3.0)])
    assert states_of(events, "sensor_fault") == [(1.0, "raised"), (3.0, "cleared")]
    assert {event.subject for _, event in events} == {"speed_rad_s frozen"}


def test_the_detector_has_the_same_hysteresis() -> None:
    verdicts = [
        {"like_healthy": alike, "sentence": "a sentence", "false_alarm_rate": 0.01}
        for alike in (True, False, True, False, False, False, True, True, True)
    ]
    events = run([kept(float(i), detector=verdict) for i, verdict in enumerate(verdicts)])
    assert states_of(events, "not_like_healthy") == [(5.0, "raised"), (8.0, "cleared")]


def test_an_alarm_states_its_false_alarm_rate() -> None:
    ((_, alarm),) = [(h, event) for h, event in run(levels("hddd")) if event.kind == "alarm"]
    rate = alarm.details["false_alarms"]
    assert rate["recordings_per_hour"] == 1.0
    assert rate["per_1000_h_if_together"] == pytest.approx(1000 * 0.006)
    assert rate["per_1000_h_if_independent"] == pytest.approx(1000 * 0.006**3)


def undecided(diagnosis: Diagnosis) -> Diagnosis:
    """Return the diagnosis with the verdict "cannot tell" for friction."""
    friction = replace(diagnosis.components["friction"], verdict="cannot tell")
    return replace(diagnosis, components={**diagnosis.components, "friction": friction})


@pytest.mark.parametrize("decided", [1.0, 0.4])
def test_the_rate_of_false_alarms_of_independent_verdicts_is_below_the_stated_rate(decided: float) -> None:
    """The reference is a simulation with false verdicts frequent enough to count alarms.

    Among decided verdicts with the share f of false ones, runs of k begin at the rate (1 - f) f^k if alarms
    are cleared at once. The bound omits the factor 1 - f and the time until an alarm is cleared.
    """
    share, count = 0.3, 1500
    random = np.random.default_rng(0)
    decides, is_false = random.random(count) < decided, random.random(count) < share
    undecided_document = json.loads(row_of(undecided(diagnosis(RECORDING, THESIS, 0.0)))["document"])
    by_verdict = {
        False: kept(0.0),
        True: kept(0.0, 0.5),
        None: kept(0.0, faults=undecided_document["faults"]),
    }
    diagnoses = [
        replace(by_verdict[bool(is_wrong) if is_decided else None], flight=Flight(float(i), None, None))
        for i, (is_decided, is_wrong) in enumerate(zip(decides, is_false, strict=True))
    ]
    alarms = sum(state == "raised" for _, state in states_of(run(diagnoses)))
    rate = FalseAlarmRate(share * decided, 1.0, WATCH.alarm.raise_after, decided)
    assert rate.independent is not None
    assert rate.together == pytest.approx(1000 * share * decided)
    stated = rate.independent * count / 1000
    exact = (1 - share) * stated
    assert 0.3 * exact < alarms < exact + 3 * exact**0.5
    assert alarms < stated


def test_an_alarm_is_raised_despite_many_undecided_verdicts_in_between(history: History) -> None:
    settings = replace(WATCH.alarm, window=5)
    events = []
    judge = Judge(history, THESIS, settings, diagnosed, None)
    for i in range(9):
        recording = Recording({name: np.arange(60.0) + i for name in RECORDING.channels})
        result = diagnosis(recording, THESIS, 0.5)
        result = undecided(result) if i % 4 else result
        events += judge.filed(Entry("S1", THESIS.name, float(i)), recording, result, {})
    assert [(event.kind, event.hours) for event in events] == [("health_changed", 0.0), ("alarm", 8.0)]
    assert events[1].details["false_alarms"]["decided_share"] == pytest.approx(3 / 9)
