"""The verb `watch`: diagnoses recordings as they arrive, and prints events as lines of JSON."""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from emaphm.cli.interruption import interrupt, resumable
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
from emaphm.errors import HistoryError, MonitoringError
from emaphm.input_files import exists

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.monitoring import Ownership, WatchSettings, WatchTask
    from emaphm.monitoring.diagnosers import Diagnose

STREAM = "-"

LONGEST_SETTLE_S = 3600.0


@Parameter(name="*")
@dataclass(frozen=True)
class UnitOptions:
    """Unit, flight hours and part number of the recordings."""

    unit: Annotated[
        str | None, Parameter(help="Serial number of the unit, for recordings without a serial number.")
    ] = None
    hours: Annotated[
        float | None, Parameter(help="Flight hours [h], for recordings without flight hours.")
    ] = None
    name: Annotated[
        str | None,
        Parameter(
            help="Pattern of the file names with {unit}, {hours}, {cycles} and {any}, e.g. "
            "'{unit}_{hours}.csv'."
        ),
    ] = None
    part: Annotated[
        str | None, Parameter(help="Part number of all units; default the name of the actuator.")
    ] = None

    def ownership(self, actuator: "Actuator") -> "Ownership":
        """Return the source of unit and hours; `MonitoringError` if the pattern --name is invalid."""
        from emaphm.monitoring import NamePattern, Ownership

        pattern = None if self.name is None else NamePattern.parse(self.name)
        return Ownership(self.part or actuator.name, self.unit, self.hours, pattern)


@Parameter(name="*")
@dataclass(frozen=True)
class DiagnosisOptions:
    """Accepted units, and the method of the diagnosis."""

    new_units: Annotated[
        bool,
        Parameter(
            negative="",
            help="Add units that are not in the history yet; without this option, their recordings are "
            "refused.",
        ),
    ] = False
    by: By = None
    whole: Annotated[
        bool,
        Parameter(negative="", help="Diagnose each recording as a whole, without cutting it into stretches."),
    ] = False
    estimator: Annotated[
        Path | None,
        Parameter(help="Estimator written by 'emaphm train', whose answer is the start of each search."),
    ] = None
    fast: Fast = False
    healthy: Annotated[
        Path | None,
        Parameter(
            help="Detector written by 'emaphm detect learn', .json: also detect deviations that no fault "
            "explains."
        ),
    ] = None

    def task(self, source: Path | int, owner: "Ownership", actuator: "Actuator") -> "WatchTask":
        """Return the task of watching; raises an error if the estimator or the detector cannot be used."""
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
        diagnoser = ByEstimator(str(self.estimator), self.fast)
        diagnoser.check(actuator)
        return diagnoser


@Parameter(name="*")
@dataclass(frozen=True)
class EventOptions:
    """Conditions under which diagnoses and prognoses raise events, and a file is complete."""

    failure_events: FailureEvents = FailureEvents()  # noqa: RUF009 - frozen
    raise_after: Annotated[
        int,
        Parameter(
            converter=whole_number, help="Number of successive degraded diagnoses that raise an alarm."
        ),
    ] = 3
    clear_after: Annotated[
        int,
        Parameter(converter=whole_number, help="Number of successive healthy diagnoses that clear an alarm."),
    ] = 3
    settle: Annotated[
        float, Parameter(help="Time without a change after which a file counts as complete [s].")
    ] = 2.0

    def settings(self) -> "WatchSettings":
        """Return the settings of watching; `MonitoringError` or `PrognosisError` if they are invalid."""
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
        Parameter(
            allow_leading_hyphen=True, help="Folder where recordings arrive, or - to read rows from stdin."
        ),
    ],
    *,
    db: Database = DB,
    actuator: ActuatorFile = "thesis",
    ownership: UnitOptions = UnitOptions(),
    diagnosis: DiagnosisOptions = DiagnosisOptions(),
    events: EventOptions = EventOptions(),
    webhook: WebhookAddress = None,
    watcher: Annotated[
        str | None,
        Parameter(
            help="Name under which the history stores the progress; default the folder's absolute path, or "
            "'stdin'."
        ),
    ] = None,
    once: Annotated[
        bool, Parameter(negative="", help="End when all files in the folder have been diagnosed.")
    ] = False,
    seed: Seed = 0,
) -> None:
    """Diagnose recordings as they arrive; events are printed as lines of JSON and stored in the history."""
    check_seed(seed)
    check_fast(diagnosis.fast, diagnosis.estimator)
    if ownership.name is not None and source == STREAM:
        raise MonitoringError(
            "--name is a pattern of file names, which a stream does not have; leave it out, and give --unit "
            "and --hours, or columns 'unit' and 'hours'"
        )
    described = described_actuator(actuator)
    task = replace(
        diagnosis.task(_source(source), ownership.ownership(described), described),
        name=watcher or "",
        once=once,
        seed=seed,
        webhook=webhook,
    )
    task.check()
    _run(task, described, db, events.settings())


def _run(task: "WatchTask", actuator: "Actuator", db: str, settings: "WatchSettings") -> None:
    """Diagnose arriving recordings until the source ends or a signal is received; print the events."""
    from emaphm.history import History
    from emaphm.history.storage.address import Address
    from emaphm.monitoring import watch as run

    file = Address.of(db).file
    is_new = file is not None and not exists(file, HistoryError)
    with resumable("finished diagnoses are in the history; the same command resumes"):
        with History.open(db, create=True) as history, _stopped_by_signal() as stop:
            where = task.source if isinstance(task.source, Path) else "standard input"
            state = "a new history is created in" if is_new else "the history is"
            say(f"watching {where}, {state} {history.database.address.shown}")
            with counter("diagnosing", quiet=False) as count:
                printing = replace(task, lines=sys.stdout.fileno())
                done = run(printing, history, actuator, settings=settings, stop=stop, say=say, on_count=count)
        say(str(done))
        if task.once and stop.is_set():  # a script must get the exit code: files may remain
            interrupt(signal.SIGTERM, None)


def _source(text: str) -> Path | int:
    if text.startswith("-") and text != STREAM:
        raise MonitoringError(f"unknown option: {text}; see emaphm watch --help")
    if text != STREAM:
        return Path(text)
    if sys.stdin is None:
        raise MonitoringError("stdin is closed, so no rows can be read; connect it to the sender of the rows")
    return sys.stdin.fileno()


@contextmanager
def _stopped_by_signal() -> Iterator[threading.Event]:
    """Yield an event that SIGTERM sets while the body runs: a running diagnosis gets some more seconds."""
    stop = threading.Event()
    before = signal.signal(signal.SIGTERM, lambda *_: stop.set())
    try:
        yield stop
    finally:
        signal.signal(signal.SIGTERM, before)
