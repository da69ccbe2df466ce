"""The verb `watch`: recordings as they arrive, events as lines of JSON."""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
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
from emaphm.cli.units.events import Horizon, Risk, WebhookAddress, prognosis_settings
from emaphm.cli.units.history import DB, Database
from emaphm.errors import MonitoringError

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.detection import Detector
    from emaphm.monitoring import WatchSettings, WatchTask
    from emaphm.monitoring.diagnosers import ByEstimator

STREAM = "-"

LONGEST_SETTLE_S = 3600.0


def watch(
    source: Annotated[
        str,
        Parameter(allow_leading_hyphen=True, help="Folder where recordings arrive; - for rows on stdin."),
    ],
    *,
    db: Database = DB,
    actuator: ActuatorFile = "thesis",
    unit: Annotated[
        str | None, Parameter(help="Serial number, of recordings that do not say whose they are.")
    ] = None,
    hours: Annotated[
        float | None, Parameter(help="Flight hours, of recordings that do not say them [h].")
    ] = None,
    name: Annotated[
        str | None,
        Parameter(help="What file names say: {unit}, {hours}, {cycles}, {any}; e.g. '{unit}_{hours}.csv'."),
    ] = None,
    part: Annotated[
        str | None, Parameter(help="Part number of all units; the actuator's name if left out.")
    ] = None,
    new_units: Annotated[
        bool, Parameter(negative="", help="Add units that the history does not know; else they are refused.")
    ] = False,
    by: By = None,
    whole: Annotated[
        bool, Parameter(negative="", help="Diagnose each recording as a whole, without cutting stretches.")
    ] = False,
    estimator: Annotated[
        Path | None, Parameter(help="Begin each diagnosis where an estimator of 'emaphm train' says.")
    ] = None,
    fast: Fast = False,
    healthy: Annotated[
        Path | None, Parameter(help="Detector that 'detect learn' wrote, for what no fault explains: .json.")
    ] = None,
    horizon: Horizon = 200.0,
    risk: Risk = 0.05,
    raise_after: Annotated[
        int,
        Parameter(converter=whole_number, help="Degraded diagnoses in succession that raise an alarm."),
    ] = 3,
    clear_after: Annotated[
        int, Parameter(converter=whole_number, help="Healthy diagnoses in succession that clear one.")
    ] = 3,
    settle: Annotated[
        float, Parameter(help="A file is whole when it has not changed for so long [s].")
    ] = 2.0,
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
    check_fast(fast, estimator)
    described = described_actuator(actuator)
    from emaphm.monitoring import NamePattern, Ownership, WatchTask
    from emaphm.monitoring.diagnosers import search
    from emaphm.monitoring.judging import cut_stretches

    pattern = None if name is None else NamePattern.parse(name)
    task = WatchTask(
        _source(source),
        Ownership(part or described.name, unit, hours, pattern),
        watcher or "",
        split=by,
        cut=None if whole else cut_stretches,
        diagnose=search if estimator is None else _by_estimator(estimator, described, fast=fast),
        detector=None if healthy is None else _detector(healthy),
        takes_new_units=new_units,
        isolated=True,
        once=once,
        seed=seed,
        webhook=webhook,
    )
    task.check()
    settings = _settings(
        horizon=horizon, risk=risk, raise_after=raise_after, clear_after=clear_after, settle=settle
    )
    _run(task, described, db, settings)


def _run(task: "WatchTask", actuator: "Actuator", db: str, settings: "WatchSettings") -> None:
    """Judge what arrives until the source ends or a signal comes; print the events."""
    from emaphm.history import History
    from emaphm.monitoring import watch as run

    with going_on("what is judged is in the history; start it again, and it goes on"):
        with History.open(db, create=True) as history, _stopped_by_signal() as stop:
            where = task.source if isinstance(task.source, Path) else "standard input"
            say(f"watching {where}, the history is {history.database.address.shown}")
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


def _settings(
    *, horizon: float, risk: float, raise_after: int, clear_after: int, settle: float
) -> "WatchSettings":
    from emaphm.monitoring import WATCH

    for option, count in (("--raise-after", raise_after), ("--clear-after", clear_after)):
        if not 1 <= count < WATCH.alarm.window:
            raise MonitoringError(f"{option} {count}: give 1 to {WATCH.alarm.window - 1}")
    if not 0 <= settle <= LONGEST_SETTLE_S:
        raise MonitoringError(f"--settle {settle:g}: give 0 to {LONGEST_SETTLE_S:g} s")
    return replace(
        WATCH,
        alarm=replace(WATCH.alarm, raise_after=raise_after, clear_after=clear_after),
        prognosis=prognosis_settings(horizon, risk),
        folder=replace(WATCH.folder, settle_s=settle),
    )


def _by_estimator(path: Path, actuator: "Actuator", *, fast: bool) -> "ByEstimator":
    from emaphm.monitoring.diagnosers import ByEstimator

    made = ByEstimator(str(path), fast)
    made.check(actuator)
    return made


def _detector(path: Path) -> "Detector":
    from emaphm.detection import Detector

    return Detector.load(path)


@contextmanager
def _stopped_by_signal() -> Iterator[threading.Event]:
    """Yield what SIGTERM sets while the body runs: what is judged has some seconds more, then it ends."""
    stop = threading.Event()
    before = signal.signal(signal.SIGTERM, lambda *_: stop.set())
    try:
        yield stop
    finally:
        signal.signal(signal.SIGTERM, before)
