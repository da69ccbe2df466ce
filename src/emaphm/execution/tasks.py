"""An independent task and its outcome."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Task:
    """Function call that any worker may execute.

    Parameters
    ----------
    index
        Number of the task in its list, from 0.
    function, arguments
        Function and arguments, both picklable: the function is defined at the top level of a module. Its
        result is picklable, and JSON if a `ResultStore` stores it. All randomness comes from the arguments.
    key
        Identifier of the result: tasks with the same key have the same result. A `ResultStore` needs it.
    name
        Name of the task in messages.
    """

    index: int
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    key: str = ""
    name: str = ""


@dataclass(frozen=True)
class Outcome:
    """Outcome of the task `index`: its result, or the text of its `failure`, which is empty after a success.

    `wall_seconds` and `cpu_seconds` are the elapsed time of the call on its worker, and the processor time of
    the worker's process.
    """

    index: int
    result: Any = field(default=None, compare=False)
    failure: str = ""
    wall_seconds: float = 0.0
    cpu_seconds: float = 0.0


def attempt(task: Task) -> Outcome:
    """Execute a task in this process and return its outcome; an error becomes a failure of this task only."""
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        result = task.function(*task.arguments)
    except Exception as error:  # noqa: BLE001 - a task may raise anything
        return failed(task, error)
    return Outcome(task.index, result, "", time.perf_counter() - wall, time.process_time() - cpu)


def failed(task: Task, error: Exception) -> Outcome:
    """Return the outcome of a task that raised `error`, with its text on one line."""
    name = task.name or f"task {task.index}"
    return Outcome(task.index, failure=f"{name}: {type(error).__name__}: {' '.join(str(error).split())}")
