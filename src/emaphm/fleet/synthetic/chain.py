"""Processing chain of a synthetic fleet: recording, diagnosis, history, prognosis."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from emaphm.actuator.faults import NAMES
from emaphm.errors import ExecutionError, HistoryError
from emaphm.execution import OnTask, Task, check_workers, outcomes
from emaphm.fleet.synthetic.folder import CheckFlight, FleetFolder, revision
from emaphm.fleet.synthetic.plan import FleetPlan
from emaphm.fleet.synthetic.prediction import PredictionSetup, predict
from emaphm.fleet.synthetic.recordings import PART_NUMBER, fleet_actuator
from emaphm.fleet.synthetic.tasks import diagnose_flight, record_unit
from emaphm.fleet.synthetic.unit import SyntheticUnit, drawn_unit
from emaphm.history import Entry, Finding, History, Removal
from emaphm.history.storage.address import Address
from emaphm.input_files import exists
from emaphm.output_files import check_writable
from emaphm.prognosis import Evidence
from emaphm.recording import read_recording
from emaphm.recording.content import recording_hash

NOTE = "synthetic"
"""Note of each removal and finding in the history."""


@dataclass(frozen=True)
class Chain:
    """Settings of the processing of a synthetic fleet.

    Parameters
    ----------
    folder
        Folder of all results; existing results are not computed again.
    workers, scheduler
        Number of processes on this machine, or the address of a Dask scheduler; its workers share the folder.
    history
        File or address of the history; default: a file in the folder.
    horizon
        Horizon of the prognoses [h].
    on_step
        Called with the name of each step; returns None, or a function that is called with the number of
        finished tasks and of all tasks.
    """

    plan: FleetPlan
    folder: FleetFolder
    workers: int | None = None
    scheduler: str | None = None
    history: str | None = None
    horizon: float = 1000.0
    on_step: Callable[[str], OnTask | None] = lambda _: None

    @property
    def where(self) -> str | Path:
        """File or address of the history."""
        return self.history or self.folder.history


def run_chain(chain: Chain, *, simulate_only: bool = False) -> list[SyntheticUnit]:
    """Compute the missing results of a synthetic fleet, and return its units with their true levels.

    Raises
    ------
    ExecutionError
        The folder or the named history holds another fleet, workers cannot be used, or some tasks failed; the
        results of the others are kept.
    HistoryError, OutputError
        The history or the folder cannot be used.
    """
    check_workers(chain.scheduler)
    if not simulate_only:
        _check_history(chain)
    chain.folder.begin(chain.plan)
    units = [drawn_unit(chain.plan, i) for i in range(chain.plan.units)]
    with chain.folder.work.locked():
        chain.folder.work.clear()
        chain.folder.write_description(units, chain.plan, fleet_actuator(chain.plan.drawn_from))
        _record(chain, units)
        if simulate_only:
            return units
        with History.open(chain.where, create=True) as history:
            _diagnose(chain, units, history)
            _remove(units, history)
            evidence = [
                Evidence.of(history.unit(unit.serial_number)) for unit in units if _has_flights(unit, chain)
            ]
        failed = {unit.serial_number for unit in units if unit.failure is not None}
        predict(
            [of_unit for of_unit in evidence if of_unit.unit not in failed],
            evidence,
            PredictionSetup(fleet_actuator(chain.plan.drawn_from), chain.horizon, chain.plan.seed),
            chain.folder,
            workers=chain.workers,
            scheduler=chain.scheduler,
            on_task=chain.on_step("predicting"),
        )
    return units


def _check_history(chain: Chain) -> None:
    """Refuse a history that cannot be used, before the folder is begun; a missing file is not created."""
    file = Address.of(chain.where).file
    if file is None or exists(file, HistoryError):
        with History.open(chain.where, create=True):
            return
    if file.parent.resolve() != chain.folder.path.resolve():  # that folder may be missing yet
        check_writable(file)


def _record(chain: Chain, units: list[SyntheticUnit]) -> None:
    actuator, expected = fleet_actuator(chain.plan.drawn_from), revision()
    folder = str(chain.folder.path.absolute())
    missing = [
        Task(i, record_unit, (folder, chain.plan, i, actuator, expected), name=unit.serial_number)
        for i, unit in enumerate(units)
        if not all(flight.path.exists() for flight in chain.folder.flights(unit, chain.plan))
    ]
    _run_step(chain, "simulating units", missing, lambda _: None, len(units))


def _diagnose(chain: Chain, units: list[SyntheticUnit], history: History) -> None:
    """Add the missing diagnoses to the history; a diagnosis is stored before it is reported as finished."""
    actuator, expected, seed = fleet_actuator(chain.plan.drawn_from), revision(), chain.plan.seed
    place = FleetFolder(chain.folder.path.absolute())
    flights = [flight for unit in units for flight in place.flights(unit, chain.plan)]
    known = _flights_in_history(chain, flights, history)

    def is_missing(flight: CheckFlight) -> bool:
        if (flight.unit, flight.hours) not in known:
            return True
        if chain.history is None:  # the history in the folder has only diagnoses of this plan and revision
            return False
        return history.missing(_entry(flight), read_recording(flight.path, actuator), actuator, seed)

    tasks = [
        Task(i, diagnose_flight, (flight, actuator, seed, expected), name=str(flight.path))
        for i, flight in enumerate(flights)
        if is_missing(flight)
    ]

    def keep(task: Task, result: Any) -> None:
        recording, diagnosis = result
        history.add(_entry(flights[task.index]), recording, diagnosis, actuator)

    by_index = {task.index: task for task in tasks}
    _run_step(
        chain,
        "diagnosing",
        tasks,
        lambda outcome: keep(by_index[outcome.index], outcome.result),
        len(flights),
    )


def _flights_in_history(chain: Chain, flights: list[CheckFlight], history: History) -> set[tuple[str, float]]:
    """Return unit and hours of the check flights with a recording in the history.

    Raises `ExecutionError` for a named history that holds another synthetic fleet: its units have the same
    serial numbers, so that a unit would have the flights of two.
    """
    units = history.units(PART_NUMBER)
    if chain.history is None:
        return {(unit.serial_number, flight.hours) for unit in units for flight in unit.flights()}
    actuator = fleet_actuator(chain.plan.drawn_from)
    paths = {(flight.unit, flight.hours): flight.path for flight in flights}
    known = set[tuple[str, float]]()
    for unit in units:
        for diagnosis in unit.diagnoses():
            key = (unit.serial_number, diagnosis.hours)
            path = paths.get(key)
            if path is None or recording_hash(read_recording(path, actuator)) != diagnosis.recording_hash:
                raise ExecutionError(
                    f"{history.database.address.shown}: unit '{unit.serial_number}' there is of another "
                    "synthetic fleet; give each fleet a history of its own with --db"
                )
            known.add(key)
    return known


def _entry(flight: CheckFlight) -> Entry:
    # Marked as late, because workers finish in any order.
    return Entry(
        flight.unit,
        PART_NUMBER,
        flight.hours,
        flight.cycles,
        late=True,
        load=flight.stress.load,
        temperature=flight.stress.temperature,
    )


def _run_step(chain: Chain, step: str, tasks: list[Task], keep: Callable[[Any], None], total: int) -> None:
    """Run the tasks and call `keep` with each outcome; raise for failed tasks after all have finished."""
    report, failures = chain.on_step(step), []
    done = total - len(tasks)
    if report:
        report(done, total)
    with closing(outcomes(tasks, workers=chain.workers, scheduler=chain.scheduler)) as finished:
        for outcome in finished:
            if outcome.failure:
                failures.append(outcome.failure)
                continue
            keep(outcome)
            done += 1
            if report:
                report(done, total)
    if failures:
        raise ExecutionError(
            f"{step}: {len(failures)} of {len(tasks)} tasks failed, the others are kept; the first: "
            f"{failures[0]}"
        )


def _remove(units: list[SyntheticUnit], history: History) -> None:
    """Add the removals of the failed units, and the findings of a shop."""
    known = {unit.serial_number for unit in history.units(PART_NUMBER)}
    for unit in units:
        if unit.failure is None or unit.failed is None or unit.serial_number not in known:
            continue
        level = float(unit.vectors[-1][NAMES.index(unit.failed)])
        history.add_removal(unit.serial_number, Removal(unit.failure, "failed", NOTE))
        history.add_finding(
            unit.serial_number, Finding(unit.failure, unit.failed, "failed", level, note=NOTE)
        )


def _has_flights(unit: SyntheticUnit, chain: Chain) -> bool:
    return bool(unit.check_flights(chain.plan.interval).size)
