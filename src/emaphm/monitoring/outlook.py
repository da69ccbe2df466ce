"""The prognosis of each unit, kept up to date while recordings are diagnosed."""

import os
import threading
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from functools import partial

import numpy as np

from emaphm.errors import EmaphmError, HistoryError
from emaphm.execution.one_process import Calls, EndedError
from emaphm.history import Event, History
from emaphm.monitoring.settings import IsolationSettings, PrognosisSettings
from emaphm.prognosis import Prognosis, Question
from emaphm.prognosis.keeping import update_prognosis
from emaphm.prognosis.prognose import DEFAULT_QUESTION

KIND = "rul_below_horizon"

RECENT = timedelta(days=1)
"""Age of a recording up to which its unit's first prognosis is made at the start of a watcher."""

MOST_NEWER = 20
"""Latest recordings that are looked through for the one that a prognosis ends with."""

NICENESS = 5
"""Of the process that makes prognoses: a third of a core where all are busy."""


@dataclass(eq=False)
class Outlook:
    """Prognoses that are due, one a unit however many diagnoses it had meanwhile.

    With `isolation`, each is made in a process of its own, while recordings are diagnosed; that process also
    remembers the prior from the fleet.
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
        """Note that a unit has a new diagnosis."""
        self._due.setdefault(unit)

    @property
    def waiting(self) -> int:
        """Units whose prognosis is out of date."""
        return len(self._due.keys() | ({self._under_way[0]} if self._under_way else set()))

    @property
    def is_isolated(self) -> bool:
        """Whether a step waits for nothing."""
        return self.isolation is not None

    def step(self) -> bool:
        """Go on with what is due, without waiting for it where it is isolated; return whether one was made.

        Raises
        ------
        NoPrognosisError
            There is none of a unit; the text says why.
        HistoryError
            The database fails; the prognosis stays due.
        """
        if self._under_way is None and self._due:
            unit = next(iter(self._due))
            del self._due[unit]
            self._under_way = unit, self._begun(unit)
        if self._under_way is None or not self._under_way[1].done():
            return False
        (unit, made), self._under_way = self._under_way, None
        try:
            made.result()
        except HistoryError:
            self.ask(unit)
            raise
        except (EmaphmError, EndedError, MemoryError) as error:
            raise NoPrognosisError(f"no prognosis of '{unit}': {error or 'too little memory'}") from None
        return True

    def close(self) -> None:
        """Give up what is under way; it is due again at the next start."""
        self._stop.set()
        self._thread.shutdown()
        if self._calls is not None:
            self._calls.end()

    def _begun(self, unit: str) -> "Future[None]":
        """Return the prognosis of a unit, begun; where it is not isolated, over."""
        about = (unit, self.settings, self.seed, self.watcher)
        if self._calls is not None:
            return self._thread.submit(
                partial(self._calls, prognosed_at, self.history.database.address.where, *about)
            )
        made: Future[None] = Future()
        try:
            prognosed(self.history, *about)
        except Exception as error:  # noqa: BLE001 - raised where the result is asked for
            made.set_exception(error)
        else:
            made.set_result(None)
        return made


class NoPrognosisError(Exception):
    """A prognosis cannot be made; the text says why."""


def _out_of_date(history: History) -> list[str]:
    """Return the units whose prognosis is not current, and those that have none and a `RECENT` recording.

    The latter are those for which a watcher was killed before their first prognosis. A history that was
    filled long before is not prognosed as a whole.
    """
    kept = history.prognoses()
    since = (datetime.now(UTC) - RECENT).strftime("%Y-%m-%dT%H:%M:%SZ")
    return [
        one.serial_number
        for one in history.states()
        if (
            not kept[one.serial_number].is_current(one.basis)
            if one.serial_number in kept
            else one.last_at >= since
        )
    ]


def prognosed_at(where: str, unit: str, settings: PrognosisSettings, seed: int, watcher: str) -> None:
    """Do what `prognosed` does, with the history at `where`, at a lower priority than diagnoses."""
    os.setpriority(os.PRIO_PROCESS, 0, NICENESS)
    with History.open(where) as history:
        prognosed(history, unit, settings, seed, watcher)


def prognosed(
    history: History, serial_number: str, settings: PrognosisSettings, seed: int = 0, watcher: str = ""
) -> None:
    """Bring the prognosis of a unit up to date, with the prior from its fleet, and add the event of it."""
    unit = history.unit(serial_number)
    question = Question(max(settings.horizon, DEFAULT_QUESTION.horizon), settings.risk)

    def events(made: Prognosis) -> Sequence[Event]:
        return rul_events(history, made, settings, watcher)

    update_prognosis(history, unit, question, seed=seed, most=settings.most, events=events)


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
    # Further recordings may have come while the prognosis was made.
    latest = history.unit(unit).diagnoses(MOST_NEWER)
    newer = [one for one in latest if one.hours > made.evidence.hours]
    last = latest[max(len(latest) - len(newer), 1) - 1]
    low, high = made.to_dict()["rul_hours"]["interval90"]
    none = "nothing in sight" if made.evidence.unrepaired is None else "a cause that no finding says"
    about = (
        f"{unit} at {made.evidence.hours:.9g} h: probability of failure within {settings.horizon:.9g} h is "
        f"{100 * risk:.1f} %, by {made.cause or none}"
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
            message=about,
            subject="",
            unit=unit,
            hours=made.evidence.hours,
            recording=last.recording,
            recording_hash=last.recording_hash,
            details=details,
            watcher=watcher,
        )
    ]
