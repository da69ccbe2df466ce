"""Waiting for an action of another thread or process, and sending a signal to this process then."""

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

PATIENCE_S = 60.0


def wait_for(condition: Callable[[], object], patience_s: float = PATIENCE_S) -> None:
    """Return when `condition` holds, within `patience_s`."""
    deadline = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@contextmanager
def signal_once(number: int, condition: Callable[[], object], then: Callable[[], None]) -> Iterator[None]:
    """Within the block, wait in a thread until `condition` holds, call `then`, and send the signal.

    After the end of the block, for example by an error, no signal is sent to this process.
    """
    ended = threading.Event()

    def send() -> None:
        try:
            wait_for(lambda: ended.is_set() or condition())
            if not ended.is_set():
                then()
        finally:
            if not ended.is_set():
                os.kill(os.getpid(), number)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
