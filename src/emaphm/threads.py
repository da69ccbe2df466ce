"""Parallel evaluation of a function in threads; simulations release the interpreter lock."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from emaphm.progress import Progress

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_threads(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    workers: int | None,
    on_progress: Progress | None = None,
) -> list[Result]:
    """Return the values of `function` for the `items`, in their order, evaluated by `workers` threads.

    By default, one thread per core. An error for an item is raised in the calling thread, which also reports
    progress.
    """
    items = list(items)
    workers = min(workers or os.cpu_count() or 1, len(items))
    if workers <= 1:
        return _collected(map(function, items), len(items), on_progress)
    with ThreadPoolExecutor(workers) as pool:
        return _collected(pool.map(function, items), len(items), on_progress)


def _collected(results: Iterable[Result], count: int, on_progress: Progress | None) -> list[Result]:
    """Return the results as a list, and report progress after each."""
    collected = []
    for result in results:
        collected.append(result)
        if on_progress:
            on_progress(len(collected) / count)
    return collected
