"""One piece of work that depends on no other, and what became of it."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Task:
    """A function to call, on whichever worker.

    Parameters
    ----------
    index
        Number of the task among its own, from 0.
    function, arguments
        Both picklable: the function stands at the top level of a module. What it returns is picklable, and
        JSON where a `ResultStore` keeps it. All its randomness comes from the arguments.
    key
        Identifies the result: two tasks of the same key have the same result. Needed by a `ResultStore`.
    name
        What a message calls the task.
    """

    index: int
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    key: str = ""
    name: str = ""


@dataclass(frozen=True)
class Outcome:
    """What became of the task `index`: its result, or the `failure` text, which is empty where it succeeded.

    `wall_seconds` and `cpu_seconds` are those of the call on its worker: elapsed time, and processor time of
    the worker's process.
    """

    index: int
    result: Any = field(default=None, compare=False)
    failure: str = ""
    wall_seconds: float = 0.0
    cpu_seconds: float = 0.0


def attempt(task: Task) -> Outcome:
    """Return the outcome of a task, done here: one that fails must not take the others with it."""
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        result = task.function(*task.arguments)
    except Exception as error:  # noqa: BLE001 - a task may raise anything
        return failed(task, error)
    return Outcome(task.index, result, "", time.perf_counter() - wall, time.process_time() - cpu)


def failed(task: Task, error: Exception) -> Outcome:
    """Return the outcome of a task that ended in `error`, its text on one line."""
    what = task.name or f"task {task.index}"
    return Outcome(task.index, failure=f"{what}: {type(error).__name__}: {' '.join(str(error).split())}")
