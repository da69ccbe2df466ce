"""Judging a recording: cutting, diagnosis, addition to the history, and the resulting events."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from emaphm.actuator import Actuator
from emaphm.errors import RecordingError
from emaphm.history import Entry, Event, History, KeptDiagnosis
from emaphm.history.events import read_events
from emaphm.history.reading import unit_or_none
from emaphm.monitoring.arrival import Call, call_here
from emaphm.monitoring.conditions import Situation, health_events, reach_far_enough
from emaphm.monitoring.diagnosers import Diagnose, methods_of
from emaphm.monitoring.order import Arrivals, hours_events
from emaphm.monitoring.settings import AlarmSettings
from emaphm.recording import Recording
from emaphm.recording.content import recording_hash

if TYPE_CHECKING:
    from emaphm.detection import Detector
    from emaphm.diagnosis import Diagnosis


Cut = Callable[[Recording, Actuator], list[Recording]]
"""Function that returns the parts of a recording that identify faults."""


def cut_stretches(recording: Recording, actuator: Actuator) -> list[Recording]:
    """Return the stretches of a recording that identify faults, each with its times in its name.

    Raises
    ------
    RecordingError
        There is no such stretch; the message contains the first reason.
    """
    from emaphm.experiment.segmentation import segments

    segmentation = segments(recording, actuator)
    if not segmentation.accepted:
        # Reasons of moving stretches are reported before those of stretches at rest.
        all_reasons = (stretch.reason for stretch in segmentation.stretches)
        reasons = sorted(all_reasons, key=lambda reason: "at rest" in reason)
        reason = reasons[0] if reasons else "too short for a stretch"
        raise RecordingError(f"{recording.source}: no stretch of it identifies anything: {reason}")
    parts = segmentation.recordings()
    if len(parts) == 1 and parts[0].samples == recording.samples:
        return [recording]
    return [
        Recording(
            part.channels,
            part.sampling,
            f"{recording.source}: {stretch.start_s:.3f} to {stretch.end_s:.3f} s",
            part.notes,
            part.labels,
        )
        for part, stretch in zip(parts, segmentation.accepted, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class Judge:
    """Judges recordings; judged recordings are in the history, and are not judged again.

    Attributes
    ----------
    takes_new_units
        Whether a new unit is added to the history.
    cut
        Cuts a recording into stretches; None if a recording is judged as a whole.
    call
        Calls the cutting, the diagnosis and the comparison with healthy recordings, here or in another
        process.
    """

    history: History
    actuator: Actuator
    settings: AlarmSettings
    diagnose: Diagnose
    cut: Cut | None
    detector: "Detector | None" = None
    takes_new_units: bool = False
    seed: int = 0
    watcher: str = ""
    call: Call = call_here

    def check(self, entry: Entry) -> None:
        """Raise `RecordingError` for a recording of a new unit, unless new units are added."""
        if self.takes_new_units:
            return
        from emaphm.errors import HistoryError, HistoryUnavailableError

        try:
            self.history.unit(entry.unit)
        except HistoryUnavailableError:
            raise
        except HistoryError as error:
            raise RecordingError(
                f"{error}; add its first recording with 'emaphm history add', or give --new-units"
            ) from None

    def parts(self, recording: Recording) -> Iterator[Recording]:
        """Yield the parts of a recording to diagnose; `RecordingError` if there is none."""
        if self.cut is None:
            yield recording
        else:
            yield from self.call(self.cut, recording, self.actuator)

    def judged(self, entry: Entry, recording: Recording) -> "Diagnosis | None":
        """Return the diagnosis of a recording, None if it is already in the history."""
        if self._is_judged(entry, recording):
            return None
        diagnosis = self.call(self.diagnose, recording, self.actuator, seed=self.seed)
        if self.detector is None:
            return diagnosis
        try:
            check = self.call(self.detector.judge, recording)
        except RecordingError:  # a manoeuvre without healthy recordings, which the detector cannot judge
            return diagnosis
        return replace(diagnosis, healthy_check=check)

    def _is_judged(self, entry: Entry, recording: Recording) -> bool:
        methods = methods_of(self.diagnose)
        return not self.history.missing(entry, recording, self.actuator, self.seed, methods)

    def filed(
        self, entry: Entry, recording: Recording, diagnosis: "Diagnosis | None", details: dict[str, Any]
    ) -> list[Event]:
        """Add the result of `judged` and the resulting events to the history; return these events.

        The call may be repeated, also after an interruption: each entry is stored once. If the unit has a
        later diagnosis, there are no events on its health, since an old recording does not indicate its
        present health.

        Parameters
        ----------
        entry
            Unit and hours of the recording.
        recording
            The judged recording.
        diagnosis
            Result of `judged`.
        details
            Values that are added to the details of all events.
        """
        if diagnosis is not None:
            self.history.add(entry, recording, diagnosis, self.actuator)
        events = self._events(entry, recording_hash(recording), details)
        if events:
            self.history.add_events(*events)
        return events

    def _events(self, entry: Entry, key: str, details: dict[str, Any]) -> list[Event]:
        with self.history.database.reading() as connection:
            row = unit_or_none(connection, entry.unit)
            if row is None:
                return []
            # Another watcher, or the server, may have judged the same recording.
            before = read_events(connection, unit=entry.unit, recording_hash=key)
            arrivals = Arrivals.of(connection, row)
        unit = self.history.unit(entry.unit)
        diagnoses: Sequence[KeptDiagnosis] = unit.diagnoses(count := self.settings.window)
        is_latest = bool(diagnoses) and diagnoses[-1].recording_hash == key
        if not (is_latest or arrivals.are_behind):
            return []
        if not is_latest:  # all diagnoses are read; this is rare, because it needs wrong hours
            diagnoses = tuple(kept for kept in unit.diagnoses() if kept.recording_hash == key)
        while is_latest and len(diagnoses) == count and not reach_far_enough(diagnoses, self.settings):
            diagnoses = unit.diagnoses(count := 2 * count)
        now = Situation(
            entry.unit,
            diagnoses,
            self.history.open_conditions(entry.unit),
            unit.replacements(),
            self.settings,
            self.watcher,
            details,
        )
        events = [*(health_events(now) if is_latest else []), *hours_events(now, arrivals)]
        known = {(event.state, event.condition) for event in before if event.watcher != self.watcher}
        return [event for event in events if (event.state, event.condition) not in known]
