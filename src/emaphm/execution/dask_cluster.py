"""Execution of tasks on the workers of a Dask scheduler, which may join and leave at any time."""

import asyncio
import importlib.util
import logging
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from typing import Any

from emaphm.errors import ExecutionError
from emaphm.execution.tasks import Outcome, Task, attempt, failed

ANSWER_S = 10.0
"""Longest wait for the answer of a scheduler [s]."""


def run_on_cluster(tasks: Sequence[Task], address: str) -> Generator[Outcome]:
    """Yield the outcome of each of `tasks` as it finishes on the Dask scheduler at `address`.

    The tasks of a lost worker are repeated by another worker, as often as the scheduler allows
    (``distributed.scheduler.allowed-failures``); after that they count as failed.

    Raises
    ------
    ExecutionError
        Dask is not installed, the scheduler does not answer within ten seconds, or the connection is lost.
    """
    check_scheduler(address)
    import distributed

    with ExitStack() as stack:
        stack.enter_context(_quiet())
        client = stack.enter_context(distributed.Client(address, timeout=ANSWER_S, set_as_default=False))
        # Not pure: two callers with equal arguments would share keys, and thus results.
        futures = client.map(attempt, tasks, pure=False)
        task_of = dict(zip(futures, tasks, strict=True))
        for future in distributed.as_completed(futures, loop=client.loop):
            yield _outcome(future, task_of[future], address)
            future.release()


def _outcome(future: Any, task: Task, address: str) -> Outcome:
    from distributed import CancelledError

    try:
        outcome: Outcome = future.result()
    except CancelledError:
        raise ExecutionError(
            f"the Dask scheduler at {address} has ended; start it and this command again to continue"
        ) from None
    except Exception as error:  # noqa: BLE001 - the workers were lost, or emaphm is not installed there
        return failed(task, error)
    return outcome


def check_scheduler(address: str) -> None:
    """Check that a scheduler answers at `address`; `Client` can need a minute, and prints tracebacks.

    Raises
    ------
    ExecutionError
        Dask is not installed, or no scheduler answers within ten seconds.
    """
    if importlib.util.find_spec("distributed") is None:
        raise ExecutionError(
            "--scheduler needs the library 'dask'; install it with: pip install 'emaphm[cluster]'"
        )
    with _quiet():
        _check_answer(address)


def _check_answer(address: str) -> None:
    try:
        # In a separate thread: the thread of a notebook already has a running event loop.
        with ThreadPoolExecutor(1) as thread:
            thread.submit(asyncio.run, asyncio.wait_for(_ask(address), ANSWER_S)).result()
    except Exception as error:  # noqa: BLE001 - another service at this address may answer anything
        reason = str(error).partition("\n")[0] or f"no answer within {ANSWER_S:g} s"
        raise ExecutionError(
            f"no Dask scheduler answers at '{address}' ({reason}); start one with 'dask scheduler', or "
            "leave out --scheduler to use this machine"
        ) from None


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress Dask's log, including tracebacks, on stderr: relevant failures are raised as errors."""
    # The client's log has its own level.
    logs = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    levels = [log.level for log in logs]
    for log in logs:
        log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for log, level in zip(logs, levels, strict=True):
            log.setLevel(level)


async def _ask(address: str) -> None:
    from distributed.core import rpc

    async with rpc(address) as server:
        kind = (await server.identity())["type"]
    if kind != "Scheduler":
        raise ExecutionError(f"a {kind.lower()} is there")
