"""Runs on this machine's cores, side by side.

Processes, not threads: a run spends a third of its time in Python, where threads wait for each other
(measured: two threads are 1.4 times as fast as one, two processes 1.6 times).
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice

from emaphm.errors import StudyError
from emaphm.study.plan import Plan, Task
from emaphm.study.task import Outcome, attempt

WAITING = 2
"""Runs handed out for each worker: one under way, one to go on with."""


def run_locally(plan: Plan, tasks: Sequence[Task], workers: int | None = None) -> Generator[Outcome]:
    """Yield the outcome of each of `tasks` as it finishes, from `workers` processes (default: one a core).

    One worker is this process itself. More are started afresh, so a script that calls this needs the
    usual ``if __name__ == "__main__":``.

    Raises
    ------
    StudyError
        A worker process died.
    """
    workers = min(workers or os.cpu_count() or 1, len(tasks))
    if workers == 1:
        for task in tasks:
            yield attempt(plan.actuator, plan.manoeuvre, task)
        return
    context = multiprocessing.get_context("spawn")
    try:
        with ProcessPoolExecutor(workers, context, _begin_worker) as pool:
            yield from _as_finished(pool, plan, tasks, WAITING * workers)
    except BrokenProcessPool:
        raise StudyError(
            "a worker process died, perhaps for want of memory; start again to go on, with fewer --workers "
            "(in a script of your own: is it guarded by `if __name__ == '__main__':`?)"
        ) from None


def _as_finished(pool: Executor, plan: Plan, tasks: Sequence[Task], most: int) -> Generator[Outcome]:
    queue = iter(tasks)
    pending = {pool.submit(attempt, plan.actuator, plan.manoeuvre, task) for task in islice(queue, most)}
    try:
        while pending:
            finished, pending = wait(pending, return_when=FIRST_COMPLETED)
            for future in finished:
                pending |= {
                    pool.submit(attempt, plan.actuator, plan.manoeuvre, task) for task in islice(queue, 1)
                }
                yield future.result()
    finally:
        for future in pending:
            future.cancel()


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent, and end with it even if it is killed: else a worker waits for ever."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
