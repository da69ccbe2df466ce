"""Interruptions of the command, remembered: not every `KeyboardInterrupt` arrives where it is dealt with.

One that comes while NumPy is imported becomes an ImportError (3 of 300, at random times of the first 0.8 s),
Python drops one that it raises in a destructor, and a library in C prints one and goes on (1 of 105).
"""

import signal
import sys
from types import FrameType, TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

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


def is_wanted() -> bool:
    """Return whether this process may be interrupted: under nohup or in a shell's background it may not."""
    return signal.getsignal(signal.SIGINT) is signal.default_int_handler
