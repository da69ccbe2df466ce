"""Interruptions of the command, by Ctrl-C or SIGTERM; remembered, as some never arrive where they should.

A `KeyboardInterrupt` that comes while NumPy is imported becomes an ImportError (3 of 300, at random times of
the first 0.8 s), Python drops one that it raises in a destructor, and a library in C prints one and goes on
(1 of 105).
"""

import signal
import sys
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from sys import UnraisableHookArgs

INTERRUPTED = 128 + signal.SIGINT
"""Exit code of a command that was interrupted from the keyboard."""

_received: list[int] = []


def interrupt(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - as `signal` calls it
    """Remember the signal `number`, and raise a KeyboardInterrupt: to be given to `signal.signal`."""
    _received.append(number)
    raise KeyboardInterrupt


def print_no_lost_one() -> None:
    """Let Python print no KeyboardInterrupt, neither one that it drops nor one that a library in C prints."""
    sys.unraisablehook, sys.excepthook = _dropped, _printed


def _dropped(unraisable: "UnraisableHookArgs") -> None:
    if unraisable.exc_type is not KeyboardInterrupt:
        sys.__unraisablehook__(unraisable)


def _printed(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if kind is not KeyboardInterrupt:
        sys.__excepthook__(kind, error, trace)


def is_interrupted() -> bool:
    """Return whether `interrupt` was called in this process."""
    return bool(_received)


def raise_again() -> None:
    """Raise a KeyboardInterrupt where there was one: the work goes on, so it was lost."""
    if _received:
        raise KeyboardInterrupt


@contextmanager
def going_on(how: str) -> "Iterator[None]":
    """Let an interruption of the body say `how` to go on."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(how) from None
    except Exception:
        if not is_interrupted():
            raise
        raise KeyboardInterrupt(how) from None


def awaited() -> list[signal.Signals]:
    """Return the signals that interrupt this process: in a shell's background, SIGINT is none of them."""
    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    return [number for number, handler in usual.items() if signal.getsignal(number) is handler]


def exit_code() -> int:
    """Return the exit code of a command that was interrupted, as shells give it."""
    return 128 + _received[0] if _received else INTERRUPTED
