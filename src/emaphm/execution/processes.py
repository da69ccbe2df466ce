"""Tasks on this machine's cores, side by side.

Processes, not threads: a run of a study spends a third of its time in Python, where threads wait for each
other (measured: two threads are 1.4 times as fast as one, two processes 1.6 times).
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
"""Tasks handed out for each worker: one under way, one to go on with."""

LISTENING_S = 0.2
"""Longest wait in one go: polars has system calls restarted after Ctrl-C, so that a wait does not end."""

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Set to 1 for workers where unset: small matrices gain nothing from threads, which compete for the cores."""


def run_on_processes(tasks: Sequence[Task], workers: int | None = None) -> Generator[Outcome]:
    """Yield the outcome of each of `tasks` as it finishes, from `workers` processes (default: one a core).

    One worker is this process itself. More are started afresh, so a script that calls this needs the
    usual ``if __name__ == "__main__":``.

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
    # Only this process holds `ours`: workers see it closed when this process ends, in whichever way.
    theirs, ours = context.Pipe(duplex=False)
    try:
        with theirs, ProcessPoolExecutor(workers, context, _prepare, (theirs,)) as pool, ours:
            yield from _as_finished(pool, tasks, WAITING * workers)
    except BrokenProcessPool:
        raise ExecutionError(
            "a worker process died, for want of `if __name__ == '__main__':` in a script of your own, or "
            "of memory; start again to go on, with fewer --workers"
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
    """Start processes that Ctrl-C leaves alone, from their first moment on: they inherit what is blocked.

    SIGTERM waits too, since a process half started would be lost.
    """
    # Else it is started by the way, and Python then lets both signals through to the process after it.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Start processes whose linear algebra has one thread; they inherit the environment."""
    unset = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(unset, "1"))
    try:
        yield
    finally:
        for name in unset:
            os.environ.pop(name, None)


def _prepare(parent: Connection) -> None:
    """Make this process a worker of a pool. SIGTERM ends it: the pool sends it to all when one has died."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    end_with_parent(parent)


def end_with_parent(parent: Connection) -> None:
    """Let this process end with its parent, also one that was killed: else a worker would go on, or wait.

    `parent` is an end of a pipe whose other end only the parent holds.
    """
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Connection) -> None:
    parent.poll(None)
    os._exit(1)
