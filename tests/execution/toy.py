"""Tasks that take almost no time, for all kinds of workers."""

import os
import signal
import time
from collections.abc import Sequence
from typing import Any

from emaphm.execution import Task


def square(number: int, seconds: float = 0.0) -> dict[str, Any]:
    """Return the square of `number` after `seconds`."""
    time.sleep(seconds)
    return {"number": number, "square": number**2, "third": number / 3}


def fail_on_seven(number: int) -> dict[str, Any]:
    if number == 7:
        raise ZeroDivisionError("seven\nis not liked")
    return square(number)


def die(_: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def blocked(_: int) -> list[int]:
    """Return the signals that the worker ignores."""
    return sorted(signal.pthread_sigmask(signal.SIG_BLOCK, []))


def wait_for_ever(number: int) -> dict[str, Any]:
    """Return at once for 0, otherwise practically never."""
    time.sleep(3600 if number else 0)
    return square(number)


def tasks(count: int, function: Any = square, *more: Any) -> list[Task]:
    """Return tasks whose results are those of `function` on 0, 1, …."""
    return [Task(n, function, (n, *more), f"key {n}", f"number {n}") for n in range(count)]


def results(count: int) -> list[dict[str, Any]]:
    return [square(n) for n in range(count)]


def in_order(outcomes: Sequence[Any]) -> list[Any]:
    return [outcome.result for outcome in sorted(outcomes, key=lambda outcome: outcome.index)]
