"""Diagnosing many recordings: each by itself, side by side, the results in the order of the files."""

import json
from collections.abc import Generator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from pathlib import Path

from emaphm.actuator import Actuator
from emaphm.errors import ExecutionError
from emaphm.execution import (
    OnTask,
    Outcome,
    ResultStore,
    Task,
    check_workers,
    in_order,
    outcomes,
    run_missing,
)
from emaphm.execution.folder import WorkFolder
from emaphm.fleet.result import BatchResult
from emaphm.fleet.settings import DiagnosisSettings
from emaphm.fleet.sources import FileReading
from emaphm.fleet.task import broken, is_whole, perform, revision
from emaphm.input_files import content_digest

SETTINGS = "settings.json"


def diagnose_all(
    files: Sequence[str | Path],
    actuator: Actuator,
    settings: DiagnosisSettings = DiagnosisSettings(),  # noqa: B008 - frozen
    *,
    reading: FileReading = FileReading(),  # noqa: B008 - frozen
    workers: int | None = None,
    scheduler: str | None = None,
    folder: str | Path | None = None,
    on_file: OnTask | None = None,
) -> Generator[BatchResult]:
    """Diagnose every recording in `files`; return an iterator of the results, in the order of the files.

    Each result is that of `emaphm.diagnose` on the recording alone, whatever the number of workers. What
    cannot be read or diagnosed is a result with an error. Memory does not grow with the number of files, but
    for results that wait for an earlier file.

    Parameters
    ----------
    files
        Of recordings; see `emaphm.fleet.recording_files` for folders.
    actuator
        The description that all are diagnosed by, and that names their channels.
    settings
        The same for all: the arguments of `emaphm.diagnose`, or an estimator's file.
    reading
        How files are read: what each is cut by, what is known of all of it.
    workers
        Processes on this machine; one a core where left out. More than one needs the usual
        ``if __name__ == "__main__":`` in a script.
    scheduler
        Address of a Dask scheduler to run on instead; its workers see the files by their absolute paths.
    folder
        Where results are kept as they finish. A later call with the same folder, actuator and settings goes
        on: what is kept is not done again, unless its file has changed.
    on_file
        Called at the start and after each file: how many are done, of how many.

    Raises
    ------
    MethodError
        A setting is unknown, or does not go with another one or the actuator.
    ExecutionError, OutputError
        The workers, the scheduler or the folder cannot be used, or the folder holds results of other
        settings.
    """
    settings = settings.pinned()
    settings.check(actuator)
    check_workers(scheduler)
    paths = [Path(file).absolute() if scheduler else Path(file) for file in files]
    if scheduler and settings.estimator is not None:
        settings = replace(settings, estimator=str(Path(settings.estimator).absolute()))
    kept = None if folder is None else _prepared(Path(folder), actuator, settings, reading)
    return _results(
        _Batch(
            paths=paths,
            actuator=actuator,
            settings=settings,
            reading=reading,
            workers=workers,
            scheduler=scheduler,
            folder=kept,
            on_file=on_file,
        )
    )


@dataclass(frozen=True, eq=False)
class _Batch:
    """The arguments of `diagnose_all`, checked."""

    paths: Sequence[Path]
    actuator: Actuator
    settings: DiagnosisSettings
    reading: FileReading
    workers: int | None
    scheduler: str | None
    folder: WorkFolder | None
    on_file: OnTask | None

    def tasks(self) -> list[Task]:
        """Return one task a file."""
        expected = revision() if self.folder or self.scheduler else ""
        return [self._task(i, path, expected) for i, path in enumerate(self.paths)]

    def _task(self, number: int, path: Path, expected: str) -> Task:
        """Return a file's task; in the folder, its name and its content identify the result."""
        content = None if self.folder is None else content_digest(path)
        arguments = (str(path), self.actuator, self.settings, self.reading, expected, content)
        return Task(number, perform, arguments, "" if content is None else f"{content} {path}", str(path))


def _results(batch: _Batch) -> Generator[BatchResult]:
    with ExitStack() as stack:
        store, done = None, set[int]()
        tasks = batch.tasks()
        if batch.folder is not None:
            stack.enter_context(batch.folder.locked())
            batch.folder.clear()
            store = ResultStore(batch.folder.results)
            done = store.finished(tasks)
        missing = [task for task in tasks if task.index not in done]
        arriving = stack.enter_context(closing(_counted(_running(batch, missing, store), len(done), batch)))
        for task, outcome in in_order(tasks, arriving, store, done, keeps=is_whole):
            for values in [broken(task.name, outcome.failure)] if outcome.failure else outcome.result:
                yield BatchResult(values)


def _running(batch: _Batch, tasks: list[Task], store: ResultStore | None) -> Generator[Outcome]:
    if store is None:
        return outcomes(tasks, workers=batch.workers, scheduler=batch.scheduler)
    return run_missing(tasks, store, workers=batch.workers, scheduler=batch.scheduler, keeps=is_whole)


def _counted(arriving: Generator[Outcome], done: int, batch: _Batch) -> Generator[Outcome]:
    """Pass outcomes on, and call `on_file` after each."""
    total = len(batch.paths)
    with closing(arriving):
        if batch.on_file:
            batch.on_file(done, total)
        for count, outcome in enumerate(arriving, start=done + 1):
            if batch.on_file:
                batch.on_file(count, total)
            yield outcome


def _prepared(
    path: Path, actuator: Actuator, settings: DiagnosisSettings, reading: FileReading
) -> WorkFolder:
    """Return the folder at `path`, begun or of the same settings."""
    folder = WorkFolder(path, SETTINGS, "batch of diagnoses", ExecutionError)
    here = {
        "revision": revision(),
        "actuator": actuator.model_dump(mode="json"),
        "settings": settings.to_dict(),
        "reading": reading.to_dict(),
    }
    differing = folder.begin_or_resume(json.dumps(here, indent=1))
    if differing:
        raise ExecutionError(
            f"{path} holds results of other settings: {differing}; give the same ones, or another folder "
            "with -o"
        )
    return folder
