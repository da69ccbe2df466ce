"""Parallel execution of tasks on the cores of this machine.

Processes are used instead of threads, because a run of a study spends a third of its time in Python, where
threads wait for each other (measured: two threads are 1.4 times as fast as one, two processes 1.6 times).
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection

from emaphm.errors import ExecutionError
from emaphm.execution.tasks import Outcome, Task, attempt

WAITING = 2
"""Number of submitted tasks per worker: one running, one waiting."""

LISTENING_S = 0.2
"""Longest single wait [s]: polars restarts system calls after Ctrl-C, so that Ctrl-C does not end a wait."""

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Environment variables that are set to 1 for workers if unset: threads do not accelerate small matrices, and
compete for the cores."""


def run_on_processes(tasks: Sequence[Task], workers: int | None = None) -> Generator[Outcome]:
    """Yield the outcome of each of `tasks` as it finishes, from `workers` processes (default: one per core).

    A single worker is this process itself. Several workers are new processes, so that a script that calls
    this function needs the usual ``if __name__ == "__main__":``.

    Raises
    ------
    ExecutionError
        A worker process died.
    """
    workers = min(workers or os.cpu_count() or 1, len(tasks))
    if workers <= 1:
        yield from map(attempt, tasks)
        return
    context = multiprocessing.get_context("spawn")
    # Only this process has `our_end` open: workers notice its closing when this process ends in any way.
    worker_end, our_end = context.Pipe(duplex=False)
    try:
        with (
            worker_end,
            ProcessPoolExecutor(workers, context, _prepare_pool_worker, (worker_end,)) as pool,
            our_end,
        ):
            yield from _as_finished(pool, tasks, WAITING * workers)
    except BrokenProcessPool:
        raise ExecutionError(
            "a worker process died, because your script lacks `if __name__ == '__main__':`, or because of "
            "too little memory; start again to go on, with fewer --workers"
        ) from None


def _as_finished(pool: Executor, tasks: Sequence[Task], most: int) -> Generator[Outcome]:
    queue = iter(tasks)
    pending: set[Future[Outcome]] = set()
    while True:
        with interrupts_held_back(), _one_thread_each():
            pending |= {pool.submit(attempt, task) for task in islice(queue, most - len(pending))}
        if not pending:
            return
        finished, pending = wait(pending, LISTENING_S, FIRST_COMPLETED)
        for future in finished:
            yield future.result()


@contextmanager
def interrupts_held_back() -> Iterator[None]:
    """Block Ctrl-C and SIGTERM while processes are started; the processes inherit the blocked signals.

    SIGTERM is also blocked, because it would leave a partly started process behind.
    """
    # Otherwise it is started with the first process, and Python then unblocks both signals.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Set the environment of processes that are started to one thread for linear algebra."""
    unset = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(unset, "1"))
    try:
        yield
    finally:
        for name in unset:
            os.environ.pop(name, None)


def _prepare_pool_worker(parent: Connection) -> None:
    """Make this process a worker of a pool, which sends SIGTERM to all workers if one worker has died."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    end_with_parent(parent)


def end_with_parent(parent: Connection) -> None:
    """End this process when its parent ends or is killed; otherwise a worker would continue or wait forever.

    `parent` is an end of a pipe whose other end is open only in the parent.
    """
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Connection) -> None:
    parent.poll(None)
    os._exit(1)
