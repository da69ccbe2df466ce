"""The verb `watch`: recordings as they arrive, events as lines of JSON."""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from emaphm.cli.interruption import going_on, interrupt
from emaphm.cli.options import (
    ActuatorFile,
    By,
    Fast,
    Seed,
    check_fast,
    check_seed,
    described_actuator,
    whole_number,
)
from emaphm.cli.output import counter, say
from emaphm.cli.units.events import FailureEvents, WebhookAddress
from emaphm.cli.units.history_options import DB, Database
from emaphm.errors import MonitoringError

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.monitoring import Ownership, WatchSettings, WatchTask
    from emaphm.monitoring.diagnosers import Diagnose

STREAM = "-"

LONGEST_SETTLE_S = 3600.0


@Parameter(name="*")
@dataclass(frozen=True)
class Whose:
    """Whose recordings these are, and of when."""

    unit: Annotated[
        str | None, Parameter(help="Serial number, of recordings that do not say whose they are.")
    ] = None
    hours: Annotated[
        float | None, Parameter(help="Flight hours, of recordings that do not say them [h].")
    ] = None
    name: Annotated[
        str | None,
        Parameter(help="What file names say: {unit}, {hours}, {cycles}, {any}; e.g. '{unit}_{hours}.csv'."),
    ] = None
    part: Annotated[
        str | None, Parameter(help="Part number of all units; the actuator's name if left out.")
    ] = None

    def ownership(self, actuator: "Actuator") -> "Ownership":
        """Return how unit and hours are known; `MonitoringError` where --name cannot be understood."""
        from emaphm.monitoring import NamePattern, Ownership

        pattern = None if self.name is None else NamePattern.parse(self.name)
        return Ownership(self.part or actuator.name, self.unit, self.hours, pattern)


@Parameter(name="*")
@dataclass(frozen=True)
class Judging:
    """Whose recordings are taken, and how they are judged."""

    new_units: Annotated[
        bool, Parameter(negative="", help="Add units that the history does not know; else they are refused.")
    ] = False
    by: By = None
    whole: Annotated[
        bool, Parameter(negative="", help="Diagnose each recording as a whole, without cutting stretches.")
    ] = False
    estimator: Annotated[
        Path | None, Parameter(help="Begin each diagnosis where an estimator of 'emaphm train' says.")
    ] = None
    fast: Fast = False
    healthy: Annotated[
        Path | None, Parameter(help="Detector that 'detect learn' wrote, for what no fault explains: .json.")
    ] = None

    def task(self, source: Path | int, owner: "Ownership", actuator: "Actuator") -> "WatchTask":
        """Return what is watched and how; errors where the estimator or the detector cannot be used."""
        from emaphm.detection import Detector
        from emaphm.monitoring import WatchTask
        from emaphm.monitoring.judging import cut_stretches

        return WatchTask(
            source,
            owner,
            split=self.by,
            cut=None if self.whole else cut_stretches,
            diagnose=self._diagnoser(actuator),
            detector=None if self.healthy is None else Detector.load(self.healthy),
            takes_new_units=self.new_units,
            isolated=True,
        )

    def _diagnoser(self, actuator: "Actuator") -> "Diagnose":
        from emaphm.monitoring.diagnosers import ByEstimator, search

        if self.estimator is None:
            return search
        made = ByEstimator(str(self.estimator), self.fast)
        made.check(actuator)
        return made


@Parameter(name="*")
@dataclass(frozen=True)
class Raising:
    """From when on what is judged makes an event, and when a file is judged."""

    failure_events: FailureEvents = FailureEvents()  # noqa: RUF009 - frozen
    raise_after: Annotated[
        int,
        Parameter(converter=whole_number, help="Degraded diagnoses in succession that raise an alarm."),
    ] = 3
    clear_after: Annotated[
        int, Parameter(converter=whole_number, help="Healthy diagnoses in succession that clear one.")
    ] = 3
    settle: Annotated[float, Parameter(help="A file is whole when it has not changed for so long [s].")] = 2.0

    def settings(self) -> "WatchSettings":
        """Return the settings of watching; `MonitoringError` or `PrognosisError` where they cannot be."""
        from emaphm.monitoring import WATCH

        after = {"raise_after": self.raise_after, "clear_after": self.clear_after}
        for name, count in after.items():
            if not 1 <= count < WATCH.alarm.window:
                option = f"--{name.replace('_', '-')}"
                raise MonitoringError(f"{option} {count}: give 1 to {WATCH.alarm.window - 1}")
        if not 0 <= self.settle <= LONGEST_SETTLE_S:
            raise MonitoringError(f"--settle {self.settle:g}: give 0 to {LONGEST_SETTLE_S:g} s")
        return replace(
            WATCH,
            alarm=replace(WATCH.alarm, **after),
            prognosis=self.failure_events.settings(),
            folder=replace(WATCH.folder, settle_s=self.settle),
        )


def watch(
    source: Annotated[
        str,
        Parameter(allow_leading_hyphen=True, help="Folder where recordings arrive; - for rows on stdin."),
    ],
    *,
    db: Database = DB,
    actuator: ActuatorFile = "thesis",
    whose: Whose = Whose(),
    judging: Judging = Judging(),
    raising: Raising = Raising(),
    webhook: WebhookAddress = None,
    watcher: Annotated[
        str | None,
        Parameter(help="Name under which the history keeps how far it is; the folder, or 'stdin'."),
    ] = None,
    once: Annotated[
        bool, Parameter(negative="", help="End when all files that are there are judged.")
    ] = False,
    seed: Seed = 0,
) -> None:
    """Judge recordings as they arrive; events are printed as lines of JSON and kept in the history."""
    check_seed(seed)
    check_fast(judging.fast, judging.estimator)
    described = described_actuator(actuator)
    task = replace(
        judging.task(_source(source), whose.ownership(described), described),
        name=watcher or "",
        once=once,
        seed=seed,
        webhook=webhook,
    )
    task.check()
    _run(task, described, db, raising.settings())


def _run(task: "WatchTask", actuator: "Actuator", db: str, settings: "WatchSettings") -> None:
    """Judge what arrives until the source ends or a signal comes; print the events."""
    from emaphm.history import History
    from emaphm.history.storage.address import Address
    from emaphm.monitoring import watch as run

    file = Address.of(db).file
    is_new = file is not None and not file.exists()
    with going_on("what is judged is in the history; start it again, and it goes on"):
        with History.open(db, create=True) as history, _stopped_by_signal() as stop:
            where = task.source if isinstance(task.source, Path) else "standard input"
            what = "a new history is made in" if is_new else "the history is"
            say(f"watching {where}, {what} {history.database.address.shown}")
            with counter("judging", quiet=False) as count:
                printing = replace(task, lines=sys.stdout.fileno())
                done = run(printing, history, actuator, settings=settings, stop=stop, say=say, on_count=count)
        say(str(done))
        if task.once and stop.is_set():  # a script must see that files may be left
            interrupt(signal.SIGTERM, None)


def _source(text: str) -> Path | int:
    if text.startswith("-") and text != STREAM:
        raise MonitoringError(f"unknown option: {text}; see emaphm watch --help")
    return sys.stdin.fileno() if text == STREAM else Path(text)


@contextmanager
def _stopped_by_signal() -> Iterator[threading.Event]:
    """Yield what SIGTERM sets while the body runs: what is judged has some seconds more, then it ends."""
    stop = threading.Event()
    before = signal.signal(signal.SIGTERM, lambda *_: stop.set())
    try:
        yield stop
    finally:
        signal.signal(signal.SIGTERM, before)
