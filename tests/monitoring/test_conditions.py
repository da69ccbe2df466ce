"""What a diagnosis changes: alarms with hysteresis, and the rate at which they are false."""

import json
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from emaphm.diagnosis import Diagnosis
from emaphm.history import Entry, Event, Flight, History, KeptDiagnosis, KeptSettings, Replacement
from emaphm.history.columns import columns_of
from emaphm.monitoring.conditions import Situation, health_events
from emaphm.monitoring.false_alarms import FalseAlarmRate
from emaphm.monitoring.judging import Judge
from emaphm.monitoring.settings import WATCH
from emaphm.recording import Recording

from .stand_in import THESIS, diagnosed, diagnosis

RECORDING = Recording({name: np.arange(60.0) for name in ("time_s", "command_rad", "current_A")})


def kept(hours: float, friction: float = 0.0, *, explained: bool = True, **document: object) -> KeptDiagnosis:
    row = columns_of(replace(diagnosis(RECORDING, THESIS, friction), explained=explained))
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
    """Return the events of diagnoses that come one by one, with the hours of each."""
    found: list[tuple[float, Event]] = []
    still: dict[tuple[str | None, str, str], Event] = {}
    for i in range(len(diagnoses)):
        known = [one for one in replacements if one.hours < diagnoses[i].hours]
        now = Situation("S1", diagnoses[max(0, i - 29) : i + 1], list(still.values()), known, WATCH.alarm)
        for event in health_events(now):
            found.append((diagnoses[i].hours, event))
            if event.kind != "health_changed":
                still.pop(event.condition, None)
                if event.state == "raised":
                    still[event.condition] = event
    return found


def shown(found: Sequence[tuple[float, Event]], kind: str = "alarm") -> list[tuple[float, str]]:
    return [(hours, event.state) for hours, event in found if event.kind == kind]


def levels(text: str) -> list[KeptDiagnosis]:
    """Return a diagnosis a letter: healthy, degraded, unexplained."""
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
def test_an_alarm_needs_several_diagnoses_in_succession(text: str, expected: list[tuple[float, str]]) -> None:
    assert shown(run(levels(text))) == expected


def test_health_changes_with_each_decided_verdict() -> None:
    found = run(levels("hhduhd"))
    changes = [(hours, one.details["verdict"]) for hours, one in found if one.kind == "health_changed"]
    assert changes == [(2.0, "degraded"), (4.0, "healthy"), (5.0, "degraded")]


def test_a_replacement_ends_an_alarm_and_what_came_before_it() -> None:
    found = run(levels("ddddhddhddd"), [Replacement(3.0, "friction")])
    assert shown(found) == [(2.0, "raised"), (4.0, "cleared"), (10.0, "raised")]
    assert "replaced at 3 h" in next(one.message for _, one in found if one.state == "cleared")
    assert shown(run(levels("dddd"), [Replacement(2.0, "gain")])) == [(2.0, "raised")]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("hddhh", [(1.0, "degraded"), (3.0, "healthy")]),
        ("hdddd", [(1.0, "degraded"), (3.0, "degraded")]),
        ("hhhhh", []),
        ("hhhdd", [(3.0, "degraded")]),
    ],
)
def test_health_of_a_new_one_is_news_unless_both_were_healthy(
    text: str, expected: list[tuple[float, str]]
) -> None:
    found = run(levels(text), [Replacement(2.0, "friction")])
    changes = [(hours, one.details["verdict"]) for hours, one in found if one.kind == "health_changed"]
    assert changes == expected


def test_what_is_not_explained_is_raised_and_cleared_once() -> None:
    found = run(levels("huuhh"))
    assert shown(found, "not_explained") == [(1.0, "raised"), (3.0, "cleared")]


def test_sensor_faults_are_conditions_by_channel() -> None:
    frozen = {"channel": "speed_rad_s", "kind": "frozen", "sentence": "The sensor is frozen."}
    found = run([kept(0.0), kept(1.0, sensor_faults=[frozen]), kept(2.0, sensor_faults=[frozen]), kept(3.0)])
    assert shown(found, "sensor_fault") == [(1.0, "raised"), (3.0, "cleared")]
    assert {one.subject for _, one in found} == {"speed_rad_s frozen"}


def test_the_detector_has_the_same_hysteresis() -> None:
    said = [
        {"like_healthy": alike, "sentence": "a sentence", "false_alarm_rate": 0.01}
        for alike in (True, False, True, False, False, False, True, True, True)
    ]
    found = run([kept(float(i), detector=one) for i, one in enumerate(said)])
    assert shown(found, "not_like_healthy") == [(5.0, "raised"), (8.0, "cleared")]


def test_an_alarm_states_its_false_alarm_rate() -> None:
    ((_, alarm),) = [(h, one) for h, one in run(levels("hddd")) if one.kind == "alarm"]
    rate = alarm.details["false_alarms"]
    assert rate["recordings_per_hour"] == 1.0
    assert rate["per_1000_h_if_together"] == pytest.approx(1000 * 0.006)
    assert rate["per_1000_h_if_independent"] == pytest.approx(1000 * 0.006**3)


def undecided(diagnosis: Diagnosis) -> Diagnosis:
    """Return the diagnosis with a friction of which it cannot tell."""
    friction = replace(diagnosis.components["friction"], verdict="cannot tell")
    return replace(diagnosis, components={**diagnosis.components, "friction": friction})


@pytest.mark.parametrize("decided", [1.0, 0.4])
def test_false_alarms_of_independent_verdicts_stay_below_what_is_stated(decided: float) -> None:
    """By simulation, with false verdicts so frequent that alarms can be counted.

    Among those that decide, the onsets of runs of k have the rate (1 - f) f^k, with the share f of false ones
    of them, where alarms are cleared at once; the bound leaves out the factor, and that clearing takes time.
    """
    share, count = 0.3, 1500
    random = np.random.default_rng(0)
    decides, false = random.random(count) < decided, random.random(count) < share
    cannot = json.loads(columns_of(undecided(diagnosis(RECORDING, THESIS, 0.0)))["document"])
    of = {False: kept(0.0), True: kept(0.0, 0.5), None: kept(0.0, faults=cannot["faults"])}
    diagnoses = [
        replace(of[bool(wrong) if sure else None], flight=Flight(float(i), None, None))
        for i, (sure, wrong) in enumerate(zip(decides, false, strict=True))
    ]
    alarms = sum(state == "raised" for _, state in shown(run(diagnoses)))
    rate = FalseAlarmRate(share * decided, 1.0, WATCH.alarm.raise_after, decided)
    assert rate.independent is not None
    assert rate.together == pytest.approx(1000 * share * decided)
    stated = rate.independent * count / 1000
    exact = (1 - share) * stated
    assert 0.3 * exact < alarms < exact + 3 * exact**0.5
    assert alarms < stated


def test_an_alarm_comes_however_many_cannot_tell_in_between(history: History) -> None:
    settings = replace(WATCH.alarm, window=5)
    found = []
    judge = Judge(history, THESIS, settings, diagnosed, None)
    for i in range(9):
        recording = Recording({name: np.arange(60.0) + i for name in RECORDING.channels})
        made = diagnosis(recording, THESIS, 0.5)
        made = undecided(made) if i % 4 else made
        found += judge.filed(Entry("S1", THESIS.name, float(i)), recording, made, {})
    assert [(one.kind, one.hours) for one in found] == [("health_changed", 0.0), ("alarm", 8.0)]
    assert found[1].details["false_alarms"]["decided_share"] == pytest.approx(3 / 9)
