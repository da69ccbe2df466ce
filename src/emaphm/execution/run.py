"""Execution of missing tasks, on this machine or on a cluster; each result is stored as it finishes."""

import time
from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from contextlib import closing
from typing import Any
from uuid import uuid4

from emaphm.execution.store import ResultStore
from emaphm.execution.tasks import Outcome, Task

OnTask = Callable[[int, int], None]
"""Function that is called after each task with the number of finished tasks and the number of tasks."""


def outcomes(
    tasks: Sequence[Task], *, workers: int | None = None, scheduler: str | None = None
) -> Generator[Outcome]:
    """Yield the outcome of each of `tasks` as it finishes.

    Parameters
    ----------
    workers
        Number of processes on this machine; default: one per core.
    scheduler
        Address of a Dask scheduler, e.g. ``tcp://10.0.0.1:8786``, to run on its workers instead.

    Raises
    ------
    ExecutionError
        A worker process died, or the scheduler cannot be used.
    """
    if not tasks:
        return
    if scheduler is None:
        from emaphm.execution.processes import run_on_processes

        yield from run_on_processes(tasks, workers)
    else:
        from emaphm.execution.dask_cluster import run_on_cluster

        yield from run_on_cluster(tasks, scheduler)


def check_workers(scheduler: str | None) -> None:
    """Raise `ExecutionError` if a scheduler cannot be used, before anything is written."""
    if scheduler is not None:
        from emaphm.execution.dask_cluster import check_scheduler

        check_scheduler(scheduler)


def run_missing(
    tasks: Sequence[Task],
    store: ResultStore,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    keeps: Callable[[Any], bool] = lambda _: True,
) -> Generator[Outcome]:
    """Execute `tasks`, store the results that `keeps` accepts, and yield each outcome as it finishes.

    Parameters
    ----------
    tasks
        All tasks are executed, even if `store` already has their results.
    store
        File of results.
    workers, scheduler
        As in `outcomes`.
    keeps
        Function that decides whether a result is stored; default: all results. Failures are never stored.

    Raises
    ------
    ExecutionError, OutputError
        The workers or the file cannot be used; finished results remain stored.
    """
    if not tasks:
        return
    by_index = {task.index: task for task in tasks}
    session, began = uuid4().hex, time.perf_counter()
    with (
        store.writing() as writer,
        closing(outcomes(tasks, workers=workers, scheduler=scheduler)) as finished,
    ):
        for outcome in finished:
            if not outcome.failure and keeps(outcome.result):
                writer.keep(by_index[outcome.index], outcome, session, time.perf_counter() - began)
            yield outcome


def in_order(
    tasks: Sequence[Task],
    arriving: Iterator[Outcome],
    store: ResultStore | None = None,
    done: Collection[int] = (),
    *,
    keeps: Callable[[Any], bool] = lambda _: True,
) -> Generator[tuple[Task, Outcome]]:
    """Yield each task with its outcome, in the order of `tasks`.

    Parameters
    ----------
    arriving
        Outcomes of all tasks except those in `done`, as they finish.
    store
        File in which `run_missing` stores the results that `keeps` accepts. A result that waits for an
        earlier task is read from the store in its turn, and needs no memory until then. Without a store, all
        results wait in memory.
    done
        Numbers of the tasks whose results the store already has.
    """
    stored, waiting = set(done), dict[int, Outcome]()
    for task in tasks:
        while task.index not in waiting and task.index not in stored:
            outcome = next(arriving)
            if store is not None and not outcome.failure and keeps(outcome.result):
                stored.add(outcome.index)
            else:
                waiting[outcome.index] = outcome
        if store is not None and task.index in stored:
            yield task, store.outcome(task)
        else:
            yield task, waiting.pop(task.index)


def run_tasks(
    tasks: Sequence[Task],
    store: ResultStore,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    on_task: OnTask | None = None,
) -> tuple[str, ...]:
    """Execute the `tasks` that `store` lacks, store each result as it finishes, and return failure texts.

    Results do not depend on the number or place of workers, or on interruptions.

    Parameters
    ----------
    tasks, store
        Tasks, and the file of their results.
    workers, scheduler
        As in `outcomes`.
    on_task
        Called at the start and after each success.

    Raises
    ------
    ExecutionError, OutputError
        The workers or the file cannot be used; finished results remain stored.
    """
    done = store.finished(tasks)
    missing = [task for task in tasks if task.index not in done]
    if on_task:
        on_task(len(done), len(tasks))
    failures = []
    with closing(run_missing(missing, store, workers=workers, scheduler=scheduler)) as finished:
        for outcome in finished:
            if outcome.failure:
                failures.append(outcome.failure)
                continue
            done.add(outcome.index)
            if on_task:
                on_task(len(done), len(tasks))
    return tuple(failures)
