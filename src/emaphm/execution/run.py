"""Doing those of many tasks that are missing, here or on a cluster; each result is kept as it finishes."""

import time
from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from contextlib import closing
from typing import Any
from uuid import uuid4

from emaphm.execution.store import ResultStore
from emaphm.execution.tasks import Outcome, Task

OnTask = Callable[[int, int], None]
"""Called after each task: how many are done, of how many."""


def outcomes(
    tasks: Sequence[Task], *, workers: int | None = None, scheduler: str | None = None
) -> Generator[Outcome]:
    """Yield the outcome of each of `tasks` as it finishes.

    Parameters
    ----------
    workers
        Processes on this machine; one a core where left out.
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
    """Refuse a scheduler that cannot be used, before anything is written; `ExecutionError` says why."""
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
    """Do `tasks`, keep the results that `keeps` accepts, and yield each outcome as it finishes.

    Parameters
    ----------
    tasks
        All are done, also those that `store` has already.
    store
        Where results are kept.
    workers, scheduler
        As for `outcomes`.
    keeps
        Whether a result is kept; all are where left out. Failures never are.

    Raises
    ------
    ExecutionError, OutputError
        The workers or the file cannot be used; what finished is kept.
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
        Outcomes of all of them but those `done`, as they finish.
    store
        Where `run_missing` keeps the results that `keeps` accepts: one that waits for an earlier task is read
        from there when its turn comes, and takes no memory until then. All wait in memory where left out.
    done
        Numbers of the tasks whose results the store had already.
    """
    kept, waiting = set(done), dict[int, Outcome]()
    for task in tasks:
        while task.index not in waiting and task.index not in kept:
            outcome = next(arriving)
            if store is not None and not outcome.failure and keeps(outcome.result):
                kept.add(outcome.index)
            else:
                waiting[outcome.index] = outcome
        if store is not None and task.index in kept:
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
    """Do those of `tasks` that `store` lacks, keep each as it finishes, and return the failures' texts.

    Results do not depend on the number of workers, on where they are, or on interruptions.

    Parameters
    ----------
    tasks, store
        What is to be done, and where results are kept.
    workers, scheduler
        As for `outcomes`.
    on_task
        Called at the start and after each success.

    Raises
    ------
    ExecutionError, OutputError
        The workers or the file cannot be used; what finished is kept.
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
