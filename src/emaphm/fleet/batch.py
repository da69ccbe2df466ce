"""Diagnosis of many recordings in parallel, with the results in the order of the files."""

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
    """Diagnose all recordings in `files`; return an iterator of the results, in the order of the files.

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
        Settings of all diagnoses: the arguments of `emaphm.diagnose`, or an estimator's file.
    reading
        How files are read: the column by which a file is split, and known values.
    workers
        Number of processes on this machine; default: one per core. More than one needs the usual
        ``if __name__ == "__main__":`` in a script.
    scheduler
        Address of a Dask scheduler to run on instead; its workers open the files by their absolute paths.
    folder
        Folder in which results are stored as they finish. A later call with the same folder, actuator and
        settings continues: a stored result is used unless its file has changed.
    on_file
        Called at the start and after each file with the number of finished files and of all files.

    Raises
    ------
    MethodError
        A setting is unknown, or not compatible with another one or the actuator.
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
    work = None if folder is None else _work_folder(Path(folder), actuator, settings, reading)
    return _results(
        _Batch(
            paths=paths,
            actuator=actuator,
            settings=settings,
            reading=reading,
            workers=workers,
            scheduler=scheduler,
            folder=work,
            on_file=on_file,
        )
    )


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
        """Return one task for each file."""
        expected = revision() if self.folder or self.scheduler else ""
        return [self._task(i, path, expected) for i, path in enumerate(self.paths)]

    def _task(self, number: int, path: Path, expected: str) -> Task:
        """Return the task of a file; in a folder, the file's name and content identify the stored result."""
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
        running = _outcomes(batch, missing, store)
        arriving = stack.enter_context(closing(_with_progress(running, len(done), batch)))
        for task, outcome in in_order(tasks, arriving, store, done, keeps=is_whole):
            for values in [broken(task.name, outcome.failure)] if outcome.failure else outcome.result:
                yield BatchResult(values)


def _outcomes(batch: _Batch, tasks: list[Task], store: ResultStore | None) -> Generator[Outcome]:
    if store is None:
        return outcomes(tasks, workers=batch.workers, scheduler=batch.scheduler)
    return run_missing(tasks, store, workers=batch.workers, scheduler=batch.scheduler, keeps=is_whole)


def _with_progress(arriving: Generator[Outcome], done: int, batch: _Batch) -> Generator[Outcome]:
    """Yield the outcomes unchanged, and call `on_file` before the first and after each."""
    total = len(batch.paths)
    with closing(arriving):
        if batch.on_file:
            batch.on_file(done, total)
        for count, outcome in enumerate(arriving, start=done + 1):
            if batch.on_file:
                batch.on_file(count, total)
            yield outcome


def _work_folder(
    path: Path, actuator: Actuator, settings: DiagnosisSettings, reading: FileReading
) -> WorkFolder:
    """Return the folder at `path`: a new one, or one of the same settings."""
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
