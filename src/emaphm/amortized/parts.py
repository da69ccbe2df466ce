"""Parallel evaluation of many draws in parts of fixed size, on all cores of this machine."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from emaphm.blas_threads import one_blas_thread

Part = TypeVar("Part")


def of_parts(of_part: Callable[[slice, int], Part], count: int, size: int) -> Iterator[Part]:
    """Yield the results of `of_part` for the parts of `count` draws, in order, evaluated on all cores.

    `of_part` is called with a part's slice and number. A part has `size` draws. The models and linear algebra
    release the interpreter's lock. BLAS has one thread in each of ours, because its own would compete with
    them. The random numbers of a part may depend on its number alone.
    """
    parts = [slice(first, first + size) for first in range(0, count, size)]
    with one_blas_thread(), ThreadPoolExecutor(os.cpu_count()) as pool:
        yield from pool.map(of_part, parts, range(len(parts)))
