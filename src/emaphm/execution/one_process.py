"""One worker process that takes one order after the other; if an order kills it, the caller goes on."""

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
    """The process died during a call, or was ended because that took too long; the text says which."""


class StoppedError(Exception):
    """The call was given up because its caller is to stop; it says nothing of the function called."""


class OneProcess:
    """A process that is started with its first order, and again after it has ended.

    Ctrl-C and SIGTERM do not end it, but `end` does, and the end of its parent.

    Parameters
    ----------
    target
        Called in the process with its end of the pipe for orders and answers, the end of another pipe for
        `end_with_parent`, and `arguments`.
    """

    def __init__(self, target: Callable[..., None], *arguments: Any) -> None:
        self._target = target
        self._arguments = arguments
        self._process: SpawnProcess | None = None
        self._ends: list[Connection] = []

    @property
    def orders(self) -> Connection:
        """The caller's end of the pipe for orders and answers."""
        return self._ends[0]

    def send(self, order: Any) -> None:
        """Give the process an order."""
        if self._process is None or not self._process.is_alive():
            self.end()
            self._start()
        self.orders.send(order)

    def death(self) -> str:
        """Return how the process has died; to be called after it has."""
        if self._process is None:
            return "its process has ended"
        self._process.join(1.0)
        code = self._process.exitcode
        if code is not None and code < 0:
            return f"its process was killed by {signal.Signals(-code).name}"
        return f"its process has died (exit status {code})"

    def end(self) -> None:
        """End the process, whatever it does."""
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
        ours, theirs = context.Pipe()
        parent, held = context.Pipe(duplex=False)
        process = context.Process(target=self._target, args=(theirs, parent, *self._arguments), daemon=True)
        with interrupts_held_back():
            process.start()
            self._process, self._ends = process, [ours, held]
            # Else Python would send it SIGTERM when it exits, and wait for its end.
            atexit.register(self.end)
        theirs.close()
        parent.close()


def prepare_worker(parent: Connection, most_bytes: int) -> None:
    """Make this process a worker: it ends with its parent, and has bounded memory and one thread.

    It leaves Ctrl-C and SIGTERM to its parent. They often come to all processes of a group at once (a
    terminal, systemd, `timeout`, job schedulers); a death would be put down to what the process works at.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    os.environ.update(dict.fromkeys(THREADS, "1"))
    end_with_parent(parent)
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    if most == resource.RLIM_INFINITY or most_bytes < most:
        resource.setrlimit(resource.RLIMIT_AS, (most_bytes, most))


class Calls:
    """Calls functions in a process of their own.

    Parameters
    ----------
    seconds
        Longest time of a call [s].
    most_bytes
        Address space that the process may have [bytes].
    stop
        Set when the caller is to stop: calls have `last_s` [s] more in all, and are then given up.
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
        """Return what `function` returns there; what it raises is raised here, with its traceback.

        Raises
        ------
        EndedError
            The process died, or was ended since it took too long. The next call starts another one.
        StoppedError
            It was given up, and its process ended, since the caller is to stop; or its process died then, as
            that may be due to who asked for the stop.
        MemoryError
            It would take more memory than the process may have.
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
            except BaseException:  # Ctrl-C: the answer to this call must not be taken for the next one's
                self._process.end()
                raise
        if error is not None:
            raise error from _ThereError(text)
        found: T = result
        return found

    def end(self) -> None:
        """End the process; a call under way in another thread raises `EndedError`."""
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


class _ThereError(Exception):
    """The traceback of what was raised in the other process."""


def _call(orders: Connection, parent: Connection, most_bytes: int) -> None:
    prepare_worker(parent, most_bytes)
    with suppress(EOFError, OSError):  # whoever asks has ended
        while True:
            function, args, kwargs = orders.recv()
            result, error, text = None, None, ""
            try:
                result = function(*args, **kwargs)
            except Exception as raised:  # noqa: BLE001 - raised where it was asked for
                error, text = raised, traceback.format_exc()
            orders.send((result, error, text))
