"""The same work on several items, in threads: a simulation lets the others run meanwhile."""

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
    """Return what `function` makes of each of the `items`, in their order, by `workers` threads.

    One a core where that is None. What is raised for one of them is raised in the thread that asked; it
    also reports progress.
    """
    items = list(items)
    workers = min(workers or os.cpu_count() or 1, len(items))
    if workers <= 1:
        return _gathered(map(function, items), len(items), on_progress)
    with ThreadPoolExecutor(workers) as pool:
        return _gathered(pool.map(function, items), len(items), on_progress)


def _gathered(results: Iterable[Result], count: int, on_progress: Progress | None) -> list[Result]:
    """Return the results as they come."""
    gathered = []
    for result in results:
        gathered.append(result)
        if on_progress:
            on_progress(len(gathered) / count)
    return gathered
