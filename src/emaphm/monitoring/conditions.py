"""What a new diagnosis changes: events on the health of its unit, with hysteresis.

All of it follows from the diagnoses that the history holds and the conditions that are open there. A watcher
that was killed goes on as if it had not been.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from emaphm.actuator import COMPONENTS
from emaphm.history import Event, KeptDiagnosis, Replacement
from emaphm.history.records import UNIT
from emaphm.monitoring.false_alarms import FalseAlarmRate, recordings_per_hour
from emaphm.monitoring.settings import AlarmSettings


@dataclass(frozen=True, eq=False)
class Situation:
    """What is known when a diagnosis was added.

    Attributes
    ----------
    unit
        Serial number.
    diagnoses
        The unit's latest ones by hours; the last is the new one.
    open
        Conditions of the unit that were raised and not cleared.
    replacements
        Of its components.
    watcher, details
        Of each event: which watcher, and values that all of them have.
    """

    unit: str
    diagnoses: Sequence[KeptDiagnosis]
    open: Sequence[Event]
    replacements: Sequence[Replacement]
    settings: AlarmSettings
    watcher: str = ""
    details: dict[str, Any] = field(default_factory=dict)

    @property
    def new(self) -> KeptDiagnosis:
        """The new diagnosis."""
        return self.diagnoses[-1]

    def event(
        self, kind: str, state: str, severity: str, message: str, subject: str = "", **details: Any
    ) -> Event:
        """Return an event on the new diagnosis."""
        new = self.new
        about = f"{self.unit} at {new.hours:.9g} h: {message}"
        return Event(
            kind=kind,
            state=state,
            severity=severity,
            message=about,
            subject=subject,
            unit=self.unit,
            hours=new.hours,
            recording=new.recording,
            recording_hash=new.recording_hash,
            details={**details, **self.details},
            watcher=self.watcher,
        )

    def opened(self, kind: str, subject: str = "") -> Event | None:
        """Return the event that raised a condition which is still open."""
        return next((one for one in self.open if (one.kind, one.subject) == (kind, subject)), None)

    def false_alarms(self, per_recording: float, decided: float = 1.0) -> FalseAlarmRate:
        """Return the rate of false alarms of this unit; `decided` is the share of recordings that decide."""
        rate = recordings_per_hour([one.hours for one in self.diagnoses[-self.settings.window :]])
        return FalseAlarmRate(per_recording, rate, self.settings.raise_after, decided)


def reach_far_enough(diagnoses: Sequence[KeptDiagnosis], settings: AlarmSettings) -> bool:
    """Return whether a unit's latest diagnoses suffice to judge all that the last of them decides.

    Those that cannot tell do not count, so that the last few that can may lie far behind.
    """
    new, fewest = diagnoses[-1], max(settings.raise_after, settings.clear_after) + 1
    counts = [
        sum(_is_decided(one, name) for one in diagnoses) for name in COMPONENTS if _is_decided(new, name)
    ]
    if "detector" in new.document:
        counts.append(sum("detector" in one.document for one in diagnoses))
    return all(count >= fewest for count in counts)


def health_events(now: Situation) -> list[Event]:
    """Return the events that the new diagnosis makes, in the order of their importance."""
    found = [event for name in COMPONENTS for event in _of_component(now, name)]
    found += [*_not_like_healthy(now), *_sensor_faults(now), *_not_explained(now)]
    return found


def _of_component(now: Situation, name: str) -> Iterator[Event]:
    renewed = max((one.hours for one in now.replacements if one.component in (name, UNIT)), default=None)
    alarm = now.opened("alarm", name)
    if alarm is not None and renewed is not None and renewed >= (alarm.hours or 0.0):
        yield now.event("alarm", "cleared", "info", f"{name} was replaced at {renewed:.9g} h", name)
        alarm = None
    decided = [one for one in now.diagnoses if _is_decided(one, name)]
    verdicts = [one.verdicts[name] for one in decided if renewed is None or one.hours > renewed]
    if not (verdicts and _is_decided(now.new, name)):
        return
    fault = now.new.document["faults"][name]
    size = f"{fault['value']:.3g} (95 %: {fault['interval95'][0]:.3g} to {fault['interval95'][1]:.3g})"
    values = {"value": fault["value"], "interval95": fault["interval95"]}
    before = decided[-2].verdicts[name] if len(decided) > 1 else "healthy"
    # Of a new one "degraded" is news whatever the old one was, and "healthy" where that was not.
    if verdicts[-1] != before or (len(verdicts) == 1 and verdicts[-1] == "degraded"):
        turned = f"turned from {before} to"
        if len(verdicts) == 1:
            since = "" if len(decided) == 1 else f" since it was replaced at {renewed:.9g} h"
            turned = f"in its first decided diagnosis{since} is"
        message = f"{name} {turned} {verdicts[-1]}, {size}"
        severity = "warning" if verdicts[-1] == "degraded" else "info"
        yield now.event("health_changed", "raised", severity, message, name, verdict=verdicts[-1], **values)
    if alarm is None and _all_last(verdicts, "degraded", now.settings.raise_after):
        rate = now.false_alarms(now.settings.false_verdicts, len(decided) / len(now.diagnoses))
        message = f"{name} is degraded in {now.settings.raise_after} diagnoses in succession, {size}"
        yield now.event("alarm", "raised", "alarm", message, name, **values, false_alarms=rate.to_dict())
    elif alarm is not None and _all_last(verdicts, "healthy", now.settings.clear_after):
        message = f"{name} is healthy in {now.settings.clear_after} diagnoses in succession, {size}"
        yield now.event("alarm", "cleared", "info", message, name, **values)


def _not_like_healthy(now: Situation) -> Iterator[Event]:
    results = [one.document["detector"] for one in now.diagnoses if "detector" in one.document]
    if not results or "detector" not in now.new.document:
        return
    alike = ["healthy" if one["like_healthy"] else "other" for one in results]
    last, is_open = results[-1], now.opened("not_like_healthy") is not None
    if not is_open and _all_last(alike, "other", now.settings.raise_after):
        rate = now.false_alarms(last["false_alarm_rate"])
        yield now.event(
            "not_like_healthy", "raised", "warning", last["sentence"], false_alarms=rate.to_dict()
        )
    elif is_open and _all_last(alike, "healthy", now.settings.clear_after):
        yield now.event("not_like_healthy", "cleared", "info", last["sentence"])


def _sensor_faults(now: Situation) -> Iterator[Event]:
    shown = {f"{one['channel']} {one['kind']}": one for one in now.new.document["sensor_faults"]}
    open_ones = {one.subject for one in now.open if one.kind == "sensor_fault"}
    for subject, fault in shown.items():
        if subject not in open_ones:
            yield now.event(
                "sensor_fault", "raised", "warning", fault["sentence"].rstrip("."), subject, fault=fault
            )
    if now.new.explained:
        for subject in sorted(open_ones - set(shown)):
            yield now.event("sensor_fault", "cleared", "info", f"{subject} no longer shows", subject)


def _not_explained(now: Situation) -> Iterator[Event]:
    is_open = now.opened("not_explained") is not None
    reasons = list(now.new.document["reasons"])
    if not now.new.explained and not is_open:
        message = "; ".join(["no model of the actuator explains the recording", *reasons])
        yield now.event("not_explained", "raised", "warning", message, reasons=reasons)
    elif now.new.explained and is_open:
        yield now.event("not_explained", "cleared", "info", "recordings are explained again")


def _is_decided(diagnosis: KeptDiagnosis, name: str) -> bool:
    return diagnosis.explained and diagnosis.verdicts[name] != "cannot tell"


def _all_last(values: Sequence[str], value: str, count: int) -> bool:
    return len(values) >= count and all(one == value for one in values[-count:])
