"""Judging one recording: cut into stretches, diagnosed, added to the history, and what that changes."""

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
"""Returns the parts of a recording that identify something."""


def cut_stretches(recording: Recording, actuator: Actuator) -> list[Recording]:
    """Return the stretches of a recording that identify something, each with its times in its name.

    Raises
    ------
    RecordingError
        None does; the first reason stands in the message.
    """
    from emaphm.experiment.segmentation import segments

    found = segments(recording, actuator)
    if not found.accepted:
        # A stretch at rest is never the reason if anything moves.
        reasons = sorted((one.reason for one in found.stretches), key=lambda reason: "at rest" in reason)
        reason = reasons[0] if reasons else "too short for a stretch"
        raise RecordingError(f"{recording.source}: no stretch of it identifies anything: {reason}")
    parts = found.recordings()
    if len(parts) == 1 and parts[0].samples == recording.samples:
        return [recording]
    return [
        Recording(
            part.channels,
            part.sampling,
            f"{recording.source}: {one.start_s:.3f} to {one.end_s:.3f} s",
            part.notes,
            part.labels,
        )
        for part, one in zip(parts, found.accepted, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class Judge:
    """Judges recordings; what it has judged stands in the history, and is not judged again.

    Attributes
    ----------
    takes_new_units
        Whether a unit that the history does not know is added to it.
    cut
        None where a recording is judged as a whole.
    call
        Calls what cuts, diagnoses and compares with healthy recordings: here, or in another process.
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
        """Refuse a recording of a unit that is not known and not to be added, `RecordingError`."""
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
        """Yield what of a recording is to be diagnosed; `RecordingError` where nothing is."""
        if self.cut is None:
            yield recording
        else:
            yield from self.call(self.cut, recording, self.actuator)

    def judged(self, entry: Entry, recording: Recording) -> "Diagnosis | None":
        """Return the diagnosis of a recording, None where the history has it already; errors as usual."""
        if self._is_judged(entry, recording):
            return None
        diagnosis = self.call(self.diagnose, recording, self.actuator, seed=self.seed)
        if self.detector is None:
            return diagnosis
        try:
            check = self.call(self.detector.judge, recording)
        except RecordingError:  # a manoeuvre that was never seen healthy: the detector says nothing of it
            return diagnosis
        return replace(diagnosis, healthy_check=check)

    def _is_judged(self, entry: Entry, recording: Recording) -> bool:
        methods = methods_of(self.diagnose)
        return not self.history.missing(entry, recording, self.actuator, self.seed, methods)

    def filed(
        self, entry: Entry, recording: Recording, diagnosis: "Diagnosis | None", details: dict[str, Any]
    ) -> list[Event]:
        """Add what `judged` gave and the events that follow from it to the history; return these.

        May be repeated, also where it was interrupted: each is there once. Where a unit has a later diagnosis
        there is none on its health: an old recording that arrives late says nothing of its health now.

        Parameters
        ----------
        details
            Values that the details of all events have.
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
            # Another watcher, or the server, may have seen the same recording.
            before = read_events(connection, unit=entry.unit, recording_hash=key)
            arrivals = Arrivals.of(connection, row)
        unit = self.history.unit(entry.unit)
        diagnoses: Sequence[KeptDiagnosis] = unit.diagnoses(count := self.settings.window)
        is_latest = bool(diagnoses) and diagnoses[-1].recording_hash == key
        if not (is_latest or arrivals.are_behind):
            return []
        if not is_latest:  # all are read: a wrong hour, which somebody is to correct
            diagnoses = tuple(one for one in unit.diagnoses() if one.recording_hash == key)
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
        found = [*(health_events(now) if is_latest else []), *hours_events(now, arrivals)]
        known = {(one.state, one.condition) for one in before if one.watcher != self.watcher}
        return [one for one in found if (one.state, one.condition) not in known]
