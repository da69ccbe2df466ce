"""The prognosis of each unit, kept up to date while nothing more urgent waits."""

import time
from dataclasses import dataclass, field

import numpy as np

from emaphm.errors import EmaphmError, HistoryError
from emaphm.history import Event, History, KeptPrognosis
from emaphm.monitoring.settings import PrognosisSettings
from emaphm.prognosis import Evidence, Prognosis, Question, prognose

KIND = "rul_below_horizon"


@dataclass(eq=False)
class Outlook:
    """Prognoses that are due, one a unit however many diagnoses it had meanwhile."""

    history: History
    settings: PrognosisSettings
    seed: int = 0
    watcher: str = ""
    _due: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        kept = self.history.prognoses()
        if kept:
            for one in self.history.overviews():
                before = kept.get(one.unit.serial_number)
                if before is not None and before.diagnoses != one.recordings:
                    self.ask(one.unit.serial_number)

    def ask(self, unit: str) -> None:
        """Note that a unit has a new diagnosis."""
        self._due.setdefault(unit, time.monotonic())

    @property
    def waiting(self) -> int:
        """Units whose prognosis is out of date."""
        return len(self._due)

    def is_urgent(self) -> bool:
        """Whether one has waited for too long."""
        first = next(iter(self._due.values()), None)
        return first is not None and time.monotonic() - first > self.settings.longest_wait_s

    def step(self) -> str | None:
        """Bring the prognosis up to date that has waited longest; return why there is none, None if done.

        Raises
        ------
        HistoryError
            The database fails; the prognosis stays due.
        """
        unit = next(iter(self._due), None)
        if unit is None:
            return None
        try:
            self._update(unit)
        except HistoryError:
            raise
        except EmaphmError as error:
            del self._due[unit]
            return f"no prognosis of '{unit}': {error}"
        del self._due[unit]
        return None

    def _update(self, serial_number: str) -> None:
        unit = self.history.unit(serial_number)
        evidence = Evidence.of(unit, self.settings.latest)
        question = Question(self.settings.horizon, self.settings.risk)
        made = prognose(evidence, unit.actuator, question, seed=self.seed, keep_past=False)
        counted = self._recordings(serial_number)
        kept = KeptPrognosis(evidence.hours, counted, made.to_dict())
        events = rul_events(self.history, made, self.settings, self.watcher)
        self.history.keep_prognosis(serial_number, kept)
        if events:
            self.history.add_events(*events)

    def _recordings(self, serial_number: str) -> int:
        return self.history.recordings(serial_number)


def rul_events(
    history: History, made: Prognosis, settings: PrognosisSettings, watcher: str = ""
) -> list[Event]:
    """Return the events that a new prognosis makes: whether a failure within the horizon has become likely.

    The horizon is that of `settings`, whatever the prognosis was made for.
    """
    unit, risk = made.evidence.unit, float(np.mean(made.sample <= settings.horizon))
    is_open = any(one.kind == KIND for one in history.open_conditions(unit))
    if not is_open and risk > settings.risk and len(made.evidence.used) >= settings.fewest:
        state, severity = "raised", "alarm"
    elif is_open and risk < settings.clears_at * settings.risk:
        state, severity = "cleared", "info"
    else:
        return []
    low, high = made.to_dict()["rul_hours"]["interval90"]
    what = f"{made.component} ({made.limit.label})" if made.limit else "nothing in sight"
    about = (
        f"{unit} at {made.evidence.hours:g} h: probability of failure within {settings.horizon:g} h is "
        f"{100 * risk:.1f} %, by {what}"
    )
    details = {
        "probability_of_failure": risk,
        "horizon_hours": settings.horizon,
        "rul_hours": {"median": made.median, "interval90": [low, high]},
        "component": made.component,
        "advice": made.advice.to_dict(made.evidence.hours),
    }
    last = history.unit(unit).diagnoses(1)[0]
    return [
        Event(
            KIND,
            state,
            severity,
            about,
            "",
            unit,
            made.evidence.hours,
            last.recording,
            last.recording_hash,
            details,
            watcher,
        )
    ]
