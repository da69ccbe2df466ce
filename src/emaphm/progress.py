"""Progress of long computations: a function that is called with the finished fraction."""

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[float], None]
"""Called with the finished fraction, from 0 to 1."""


def subprogress(on_progress: Progress | None, first: float, last: float) -> Progress | None:
    """Return the progress function of a part of the work: its 0 to 1 are `first` to `last` of the whole."""
    if on_progress is None:
        return None
    return lambda fraction: on_progress(first + (last - first) * fraction)
