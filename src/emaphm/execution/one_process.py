"""One worker process that executes one order after another; if an order kills it, the caller continues."""

import atexit
import math
import multiprocessing
import os
import resource
import signal
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from emaphm.execution.processes import LISTENING_S, THREADS, end_with_parent, interrupts_held_back

if TYPE_CHECKING:
    from multiprocessing.context import SpawnProcess

P = ParamSpec("P")
T = TypeVar("T")


class EndedError(Exception):
    """The process died during a call, or was ended because the call took too long; the text states which."""


class StoppedError(Exception):
    """The call was abandoned because its caller must stop; this is no failure of the called function."""


class OneProcess:
    """Process that starts with its first order, and restarts with the next order after it has ended.

    Ctrl-C and SIGTERM do not end it; `end` and the end of its parent do.

    Parameters
    ----------
    target
        Function that is called in the process with its end of the pipe for orders and answers, the end of
        another pipe for `end_with_parent`, and `arguments`.
    """

    def __init__(self, target: Callable[..., None], *arguments: Any) -> None:
        self._target = target
        self._arguments = arguments
        self._process: SpawnProcess | None = None
        self._ends: list[Connection] = []

    @property
    def orders(self) -> Connection:
        """Caller's end of the pipe for orders and answers."""
        return self._ends[0]

    def send(self, order: Any) -> None:
        """Send an order to the process; start the process if necessary."""
        if self._process is None or not self._process.is_alive():
            self.end()
            self._start()
        self.orders.send(order)

    def death(self) -> str:
        """Return the cause of the process's death as text; to be called after its death."""
        if self._process is None:
            return "its process has ended"
        self._process.join(1.0)
        code = self._process.exitcode
        if code is not None and code < 0:
            return f"its process was killed by {signal.Signals(-code).name}"
        return f"its process has died (exit status {code})"

    def end(self) -> None:
        """End the process at once."""
        atexit.unregister(self.end)
        for end in self._ends:
            end.close()
        self._ends = []
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = None

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        our_end, worker_end = context.Pipe()
        parent, parents_own = context.Pipe(duplex=False)
        arguments = (worker_end, parent, *self._arguments)
        process = context.Process(target=self._target, args=arguments, daemon=True)
        with interrupts_held_back():
            process.start()
            self._process, self._ends = process, [our_end, parents_own]
            # Otherwise Python sends SIGTERM at exit, which the process ignores, and waits for its end.
            atexit.register(self.end)
        worker_end.close()
        parent.close()


def prepare_worker(parent: Connection, most_bytes: int) -> None:
    """Make this process a worker: it ends with its parent, and has limited memory and one thread.

    It ignores Ctrl-C and SIGTERM, which its parent handles. All processes of a group often receive them at
    once (from a terminal, systemd, `timeout`, job schedulers), and the death of a worker would be attributed
    to its order.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    os.environ.update(dict.fromkeys(THREADS, "1"))
    end_with_parent(parent)
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    if most == resource.RLIM_INFINITY or most_bytes < most:
        resource.setrlimit(resource.RLIMIT_AS, (most_bytes, most))


class Calls:
    """Calls of functions in a separate process.

    Parameters
    ----------
    seconds
        Longest duration of a call [s].
    most_bytes
        Limit of the process's address space [bytes].
    stop
        Event that is set if the caller must stop: calls then have `last_s` [s] in total, and are abandoned
        afterwards.
    """

    def __init__(
        self, seconds: float, most_bytes: int, stop: threading.Event | None = None, last_s: float = 0.0
    ) -> None:
        self._seconds = seconds
        self._stop = stop or threading.Event()
        self._last_s, self._given_up = last_s, math.inf
        self._process = OneProcess(_call, most_bytes)
        self._lock = threading.Lock()

    def __call__(self, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> T:
        """Return the result of `function` in the process; raise its exceptions here, with their traceback.

        Raises
        ------
        EndedError
            The process died, or was ended because the call took too long. The next call starts a new process.
        StoppedError
            The call was abandoned, and its process ended, because the caller must stop; or the process died
            after the stop event, which may have had the same cause.
        MemoryError
            The call needs more memory than the limit of the process.
        """
        with self._lock:
            try:
                self._process.send((function, args, kwargs))
                result, error, text = self._answer()
            except (EOFError, OSError):
                reason = self._process.death()
                self._process.end()
                if self._stop.is_set():
                    raise StoppedError from None
                raise EndedError(reason) from None
            except BaseException:  # Ctrl-C: the answer must not be mistaken for that of the next call
                self._process.end()
                raise
        if error is not None:
            raise error from _RemoteError(text)
        returned: T = result
        return returned

    def end(self) -> None:
        """End the process; a running call in another thread raises `EndedError`."""
        self._process.end()

    def _answer(self) -> tuple[Any, Exception | None, str]:
        orders, deadline = self._process.orders, time.monotonic() + self._seconds
        while not orders.poll(LISTENING_S):
            now = time.monotonic()
            if self._stop.is_set():
                self._given_up = min(self._given_up, now + self._last_s)
            if now >= self._given_up:
                raise StoppedError
            if now > deadline:
                raise EndedError(f"it took longer than {self._seconds:g} s")
        result, error, text = orders.recv()
        return result, error, text


class _RemoteError(Exception):
    """Traceback of an exception in the worker process."""


def _call(orders: Connection, parent: Connection, most_bytes: int) -> None:
    prepare_worker(parent, most_bytes)
    with suppress(EOFError, OSError):  # the caller has ended
        while True:
            function, args, kwargs = orders.recv()
            result, error, text = None, None, ""
            try:
                result = function(*args, **kwargs)
            except Exception as raised:  # noqa: BLE001 - raised again in the caller
                error, text = raised, traceback.format_exc()
            orders.send((result, error, text))
