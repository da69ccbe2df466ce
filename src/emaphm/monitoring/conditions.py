"""Events on the health of a unit after a new diagnosis, with hysteresis.

The events follow from the diagnoses and the open conditions in the history only. Therefore a watcher that was
killed continues without loss.
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
    """State of a unit after a diagnosis was added.

    Attributes
    ----------
    unit
        Serial number.
    diagnoses
        The unit's latest diagnoses in the order of hours; the last is the new diagnosis.
    open
        Conditions of the unit that were raised and not cleared.
    replacements
        Replacements of its components.
    settings
        Thresholds of the conditions.
    watcher, details
        Name of the watcher, and further values, that are added to each event.
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
        """Return the event that raised a condition that is still open, None if it is not open."""
        return next((event for event in self.open if (event.kind, event.subject) == (kind, subject)), None)

    def false_alarms(self, per_recording: float, decided: float = 1.0) -> FalseAlarmRate:
        """Return the rate of false alarms of this unit; `decided` is the share of decided recordings."""
        window = self.diagnoses[-self.settings.window :]
        rate = recordings_per_hour([diagnosis.hours for diagnosis in window])
        return FalseAlarmRate(per_recording, rate, self.settings.raise_after, decided)


def reach_far_enough(diagnoses: Sequence[KeptDiagnosis], settings: AlarmSettings) -> bool:
    """Return whether a unit's latest diagnoses suffice for all conditions that depend on the last of them.

    Diagnoses with the verdict "cannot tell" do not count, so that the last decided diagnoses may be far back.
    """
    new, fewest = diagnoses[-1], max(settings.raise_after, settings.clear_after) + 1
    counts = [
        sum(_is_decided(diagnosis, name) for diagnosis in diagnoses)
        for name in COMPONENTS
        if _is_decided(new, name)
    ]
    if "detector" in new.document:
        counts.append(sum("detector" in diagnosis.document for diagnosis in diagnoses))
    return all(count >= fewest for count in counts)


def health_events(now: Situation) -> list[Event]:
    """Return the events that follow from the new diagnosis, in the order of their importance."""
    events = [event for name in COMPONENTS for event in _component_events(now, name)]
    events += [*_not_like_healthy(now), *_sensor_faults(now), *_not_explained(now)]
    return events


def _component_events(now: Situation, name: str) -> Iterator[Event]:
    """Yield the events on changes of the verdict and on alarms of a component."""
    replacements = [entry for entry in now.replacements if entry.component in (name, UNIT)]
    renewed = max((entry.hours for entry in replacements), default=None)
    alarm = now.opened("alarm", name)
    if alarm is not None and renewed is not None and renewed >= (alarm.hours or 0.0):
        yield now.event("alarm", "cleared", "info", f"{name} was replaced at {renewed:.9g} h", name)
        alarm = None
    decided = [diagnosis for diagnosis in now.diagnoses if _is_decided(diagnosis, name)]
    verdicts = [
        diagnosis.verdicts[name] for diagnosis in decided if renewed is None or diagnosis.hours > renewed
    ]
    if not (verdicts and _is_decided(now.new, name)):
        return
    fault = now.new.document["faults"][name]
    size = f"{fault['value']:.3g} (95 %: {fault['interval95'][0]:.3g} to {fault['interval95'][1]:.3g})"
    values = {"value": fault["value"], "interval95": fault["interval95"]}
    before = decided[-2].verdicts[name] if len(decided) > 1 else "healthy"
    # For a new component, "degraded" is always reported, "healthy" only if the old component was not healthy.
    if verdicts[-1] != before or (len(verdicts) == 1 and verdicts[-1] == "degraded"):
        change = f"turned from {before} to"
        if len(verdicts) == 1:
            since = "" if len(decided) == 1 else f" since it was replaced at {renewed:.9g} h"
            change = f"in its first decided diagnosis{since} is"
        message = f"{name} {change} {verdicts[-1]}, {size}"
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
    results = [
        diagnosis.document["detector"] for diagnosis in now.diagnoses if "detector" in diagnosis.document
    ]
    if not results or "detector" not in now.new.document:
        return
    classes = ["healthy" if result["like_healthy"] else "other" for result in results]
    last, is_open = results[-1], now.opened("not_like_healthy") is not None
    if not is_open and _all_last(classes, "other", now.settings.raise_after):
        rate = now.false_alarms(last["false_alarm_rate"])
        yield now.event(
            "not_like_healthy", "raised", "warning", last["sentence"], false_alarms=rate.to_dict()
        )
    elif is_open and _all_last(classes, "healthy", now.settings.clear_after):
        yield now.event("not_like_healthy", "cleared", "info", last["sentence"])


def _sensor_faults(now: Situation) -> Iterator[Event]:
    faults = {f"{fault['channel']} {fault['kind']}": fault for fault in now.new.document["sensor_faults"]}
    open_subjects = {event.subject for event in now.open if event.kind == "sensor_fault"}
    for subject, fault in faults.items():
        if subject not in open_subjects:
            yield now.event(
                "sensor_fault", "raised", "warning", fault["sentence"].rstrip("."), subject, fault=fault
            )
    if now.new.explained:
        for subject in sorted(open_subjects - set(faults)):
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
    return len(values) >= count and all(last == value for last in values[-count:])
