"""Interruptions of the command, remembered: not every `KeyboardInterrupt` arrives where it is dealt with.

One that comes while NumPy is imported becomes an ImportError (3 of 300, at random times of the first 0.8 s),
and Python drops one that it raises in a destructor, of which Numba has many while it compiles.
"""

import signal
import sys
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

_received: list[int] = []


def interrupt(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - as `signal` calls it
    """Remember the signal `number`, and raise a KeyboardInterrupt: to be given to `signal.signal`."""
    _received.append(number)
    raise KeyboardInterrupt


def say_nothing_of_a_dropped_one(unraisable: "UnraisableHookArgs") -> None:
    """Print what Python drops, but no KeyboardInterrupt: to be `sys.unraisablehook`."""
    if unraisable.exc_type is not KeyboardInterrupt:
        sys.__unraisablehook__(unraisable)


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
