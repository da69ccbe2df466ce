"""Diagnosis of many recordings: separately, in parallel, with results in the order of the files."""

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
    """Return an iterator of the diagnoses of all recordings in `files`, in the order of the files.

    Each result is that of `emaphm.diagnose` for the recording alone, for any number of workers. A recording
    that cannot be read or diagnosed has a result with an error. Memory does not grow with the number of
    files, except for results that wait for an earlier file.

    Parameters
    ----------
    files
        Files of recordings; see `emaphm.fleet.recording_files` for folders.
    actuator
        The description for all diagnoses, which also names the channels.
    settings
        Arguments of `emaphm.diagnose`, or an estimator's file, for all recordings.
    reading
        How files are read: splitting, and known values of their recordings.
    workers
        Processes on this machine; by default one per core. More than one needs the usual
        ``if __name__ == "__main__":`` in a script.
    scheduler
        Address of a Dask scheduler to use instead; its workers need the files under the same absolute paths.
    folder
        Folder in which results are stored as they finish. A later call with the same folder, actuator and
        settings resumes: stored results are not computed again, unless the file has changed.
    on_file
        Called at the start and after each file, with the finished and total number of files.

    Raises
    ------
    MethodError
        A setting is unknown, or contradicts another one or the actuator.
    ExecutionError, OutputError
        The workers, the scheduler or the folder cannot be used, or the folder contains results of other
        settings.
    """
    settings = settings.pinned()
    settings.check(actuator)
    check_workers(scheduler)
    paths = [Path(file).absolute() if scheduler else Path(file) for file in files]
    if scheduler and settings.estimator is not None:
        settings = replace(settings, estimator=str(Path(settings.estimator).absolute()))
    work_folder = None if folder is None else _prepared(Path(folder), actuator, settings, reading)
    return _results(_Batch(paths, actuator, settings, reading, workers, scheduler, work_folder, on_file))


@dataclass(frozen=True, eq=False)
class _Batch:
    """The checked arguments of `diagnose_all`."""

    paths: Sequence[Path]
    actuator: Actuator
    settings: DiagnosisSettings
    reading: FileReading
    workers: int | None
    scheduler: str | None
    folder: WorkFolder | None
    on_file: OnTask | None

    def tasks(self) -> list[Task]:
        """Return one task per file."""
        expected = revision() if self.folder or self.scheduler else ""
        return [self._task(i, path, expected) for i, path in enumerate(self.paths)]

    def _task(self, number: int, path: Path, expected: str) -> Task:
        """Return a file's task; with a folder, the result is identified by the file's path and content."""
        content = None if self.folder is None else content_digest(path)
        arguments = (str(path), self.actuator, self.settings, self.reading, expected, content)
        return Task(number, perform, arguments, "" if content is None else f"{content} {path}", str(path))


def _results(batch: _Batch) -> Generator[BatchResult]:
    with ExitStack() as stack:
        store, finished = None, set[int]()
        tasks = batch.tasks()
        if batch.folder is not None:
            stack.enter_context(batch.folder.locked())
            batch.folder.clear()
            store = ResultStore(batch.folder.results)
            finished = store.finished(tasks)
        missing = [task for task in tasks if task.index not in finished]
        arriving = stack.enter_context(
            closing(_counted(_running(batch, missing, store), len(finished), batch))
        )
        for task, outcome in in_order(tasks, arriving, store, finished, keeps=is_whole):
            for values in [broken(task.name, outcome.failure)] if outcome.failure else outcome.result:
                yield BatchResult(values)


def _running(batch: _Batch, tasks: list[Task], store: ResultStore | None) -> Generator[Outcome]:
    if store is None:
        return outcomes(tasks, workers=batch.workers, scheduler=batch.scheduler)
    return run_missing(tasks, store, workers=batch.workers, scheduler=batch.scheduler, keeps=is_whole)


def _counted(arriving: Generator[Outcome], finished: int, batch: _Batch) -> Generator[Outcome]:
    """Yield the outcomes, and call `on_file` after each."""
    total = len(batch.paths)
    with closing(arriving):
        if batch.on_file:
            batch.on_file(finished, total)
        for count, outcome in enumerate(arriving, start=finished + 1):
            if batch.on_file:
                batch.on_file(count, total)
            yield outcome


def _prepared(
    path: Path, actuator: Actuator, settings: DiagnosisSettings, reading: FileReading
) -> WorkFolder:
    """Return the folder at `path`, which is new or has the same settings."""
    folder = WorkFolder(path, SETTINGS, "batch of diagnoses", ExecutionError)
    inputs = {
        "revision": revision(),
        "actuator": actuator.model_dump(mode="json"),
        "settings": settings.to_dict(),
        "reading": reading.to_dict(),
    }
    differing = folder.begin_or_resume(json.dumps(inputs, indent=1))
    if differing:
        raise ExecutionError(
            f"{path} contains results of other settings: {differing}; give the same settings, or another "
            "folder with -o"
        )
    return folder
