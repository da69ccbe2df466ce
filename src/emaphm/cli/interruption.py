"""Interruptions of the command, by Ctrl-C or SIGTERM; they are recorded, because Python loses some of them.

A `KeyboardInterrupt` during the import of NumPy becomes an ImportError (3 of 300, at random times of the
first 0.8 s); Python drops a `KeyboardInterrupt` raised in a destructor; a C library prints it and continues
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
    """Record the signal `number` and raise a KeyboardInterrupt; a handler for `signal.signal`."""
    _received.append(number)
    raise KeyboardInterrupt


def hide_lost_interruptions() -> None:
    """Stop Python from printing a KeyboardInterrupt that it drops, or that a C library would print."""
    sys.unraisablehook, sys.excepthook = _print_unraisable, _print_exception


def _print_unraisable(unraisable: "UnraisableHookArgs") -> None:
    if unraisable.exc_type is not KeyboardInterrupt:
        sys.__unraisablehook__(unraisable)


def _print_exception(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if kind is not KeyboardInterrupt:
        sys.__excepthook__(kind, error, trace)


def is_interrupted() -> bool:
    """Return whether `interrupt` was called in this process."""
    return bool(_received)


def raise_again() -> None:
    """Raise a KeyboardInterrupt if a signal was received: the work continues, so the first one was lost."""
    if _received:
        raise KeyboardInterrupt


@contextmanager
def resumable(hint: str) -> "Iterator[None]":
    """Add `hint`, on how to resume the work, to an interruption of the body."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(hint) from None
    except Exception:
        if not is_interrupted():
            raise
        raise KeyboardInterrupt(hint) from None


def handled_signals() -> list[signal.Signals]:
    """Return the signals that interrupt this process; without SIGINT in the background of a shell."""
    defaults = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    return [number for number, handler in defaults.items() if signal.getsignal(number) is handler]


def exit_code() -> int:
    """Return the exit code of an interrupted command, by the convention of shells: 128 + signal number."""
    return 128 + _received[0] if _received else INTERRUPTED
