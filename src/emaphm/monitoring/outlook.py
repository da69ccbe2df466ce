"""Updates of the units' prognoses in online monitoring, and the events that follow from them."""

import os
import threading
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from functools import partial

import numpy as np

from emaphm.errors import EmaphmError, HistoryFormError, HistoryUnavailableError
from emaphm.execution.one_process import Calls, EndedError
from emaphm.history import Event, History
from emaphm.monitoring.settings import IsolationSettings, PrognosisSettings
from emaphm.prognosis import Prognosis, Question
from emaphm.prognosis.keeping import update_prognosis
from emaphm.prognosis.prognose import DEFAULT_QUESTION

KIND = "rul_below_horizon"

RECENT = timedelta(days=1)
"""Largest age of a unit's last recording for which a watcher computes a first prognosis at its start."""

MOST_NEWER = 20
"""Number of latest recordings among which the last recording of a prognosis is searched."""

NICENESS = 5
"""Priority of the process of the prognoses, which has a third of a core if all cores are busy."""


@dataclass(eq=False)
class Outlook:
    """Prognoses that are due, one per unit for any number of new diagnoses.

    With `isolation`, they are computed in a separate process, in parallel to the diagnoses; that process also
    caches the prior from the fleet.
    """

    history: History
    settings: PrognosisSettings
    seed: int = 0
    watcher: str = ""
    isolation: IsolationSettings | None = None
    _due: dict[str, None] = field(default_factory=dict)
    _under_way: "tuple[str, Future[None]] | None" = None

    def __post_init__(self) -> None:
        for unit in _out_of_date(self.history):
            self.ask(unit)
        self._stop, self._thread = threading.Event(), ThreadPoolExecutor(1, "prognoses")
        self._calls = None
        if self.isolation is not None:
            self._calls = Calls(self.isolation.seconds, self.isolation.most_bytes, self._stop)

    def ask(self, unit: str) -> None:
        """Note that the prognosis of a unit is due."""
        self._due.setdefault(unit)

    @property
    def waiting(self) -> int:
        """Number of units whose prognosis is out of date."""
        return len(self._due.keys() | ({self._under_way[0]} if self._under_way else set()))

    @property
    def is_isolated(self) -> bool:
        """Whether prognoses are computed in a separate process, for which `step` does not wait."""
        return self.isolation is not None

    def step(self) -> bool:
        """Continue with the due prognoses, without waiting if isolated; return whether one was completed.

        Raises
        ------
        NoPrognosisError
            A unit has no prognosis, for the reason in the text.
        HistoryUnavailableError
            The database fails; the prognosis stays due.
        HistoryFormError
            A newer version of emaphm has changed the history meanwhile.
        """
        if self._under_way is None and self._due:
            unit = next(iter(self._due))
            del self._due[unit]
            self._under_way = unit, self._started(unit)
        if self._under_way is None or not self._under_way[1].done():
            return False
        (unit, future), self._under_way = self._under_way, None
        try:
            future.result()
        except HistoryUnavailableError:
            self.ask(unit)
            raise
        except HistoryFormError:
            raise
        # Including the error on a unit that was withdrawn meanwhile.
        except (EmaphmError, EndedError, MemoryError) as error:
            raise NoPrognosisError(f"no prognosis of '{unit}': {error or 'too little memory'}") from None
        return True

    def close(self) -> None:
        """Cancel the running prognosis; it is due again at the next start."""
        self._stop.set()
        self._thread.shutdown()
        if self._calls is not None:
            self._calls.end()

    def _started(self, unit: str) -> "Future[None]":
        """Return the future of the prognosis of a unit; if not isolated, it is already completed."""
        arguments = (unit, self.settings, self.seed, self.watcher)
        if self._calls is not None:
            return self._thread.submit(
                partial(self._calls, prognosed_at, self.history.database.address.where, *arguments)
            )
        future: Future[None] = Future()
        try:
            prognosed(self.history, *arguments)
        except Exception as error:  # noqa: BLE001 - raised by `Future.result`
            future.set_exception(error)
        else:
            future.set_result(None)
        return future


class NoPrognosisError(Exception):
    """A prognosis cannot be computed, for the reason in the text."""


def _out_of_date(history: History) -> list[str]:
    """Return the units whose prognosis is not current, and units with a `RECENT` recording without prognosis.

    The latter occur if a watcher was killed before the first prognosis. Other units without prognosis, of a
    history that was filled long ago, are left out.
    """
    prognoses = history.prognoses()
    since = (datetime.now(UTC) - RECENT).strftime("%Y-%m-%dT%H:%M:%SZ")
    return [
        unit.serial_number
        for unit in history.states()
        if (
            not prognoses[unit.serial_number].is_current(unit.basis)
            if unit.serial_number in prognoses
            else unit.last_at >= since
        )
    ]


def prognosed_at(where: str, unit: str, settings: PrognosisSettings, seed: int, watcher: str) -> None:
    """Call `prognosed` with the history at `where`, at a lower priority than diagnoses."""
    os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    with History.open(where) as history:
        prognosed(history, unit, settings, seed, watcher)


def prognosed(
    history: History, serial_number: str, settings: PrognosisSettings, seed: int = 0, watcher: str = ""
) -> None:
    """Update the prognosis of a unit, with the prior from its fleet, and add its event to the history."""
    unit = history.unit(serial_number)
    question = Question(max(settings.horizon, DEFAULT_QUESTION.horizon), settings.risk)

    def events(made: Prognosis) -> Sequence[Event]:
        return rul_events(history, made, settings, watcher)

    update_prognosis(history, unit, question, seed=seed, most=settings.most, events=events)


def rul_events(
    history: History, made: Prognosis, settings: PrognosisSettings, watcher: str = ""
) -> list[Event]:
    """Return the event of a new prognosis if a failure within the horizon has become likely or unlikely.

    The horizon is that of `settings`, independent of the horizon of the prognosis.
    """
    unit, risk = made.evidence.unit, float(np.mean(made.sample <= settings.horizon))
    is_open = any(event.kind == KIND for event in history.open_conditions(unit))
    if not is_open and risk > settings.risk and len(made.evidence.used) >= settings.fewest:
        state, severity = "raised", "alarm"
    elif is_open and risk < settings.clears_at * settings.risk:
        state, severity = "cleared", "info"
    else:
        return []
    # Further recordings may have been added while the prognosis was computed.
    latest = history.unit(unit).diagnoses(MOST_NEWER)
    newer = [diagnosis for diagnosis in latest if diagnosis.hours > made.evidence.hours]
    last = latest[max(len(latest) - len(newer), 1) - 1]
    low, high = made.to_dict()["rul_hours"]["interval90"]
    no_cause = "nothing in sight" if made.evidence.unrepaired is None else "a cause that no finding says"
    message = (
        f"{unit} at {made.evidence.hours:.9g} h: probability of failure within {settings.horizon:.9g} h is "
        f"{100 * risk:.1f} %, by {made.cause or no_cause}"
    )
    details = {
        "probability_of_failure": risk,
        "horizon_hours": settings.horizon,
        "rul_hours": {"median": made.median, "interval90": [low, high]},
        "component": made.component,
        "fleet_units": made.belief.prior.units,
        "advice": made.advice.to_dict(made.evidence.hours),
        "made_from": {
            "diagnoses": history.basis(unit).diagnoses - len(newer),
            "replacements": len(made.evidence.replacements),
        },
    }
    return [
        Event(
            kind=KIND,
            state=state,
            severity=severity,
            message=message,
            subject="",
            unit=unit,
            hours=made.evidence.hours,
            recording=last.recording,
            recording_hash=last.recording_hash,
            details=details,
            watcher=watcher,
        )
    ]
