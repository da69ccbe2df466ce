"""Work on many draws, a part at a time, on all cores of this machine."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from emaphm.blas_threads import one_blas_thread

Part = TypeVar("Part")


def of_parts(of_part: Callable[[slice, int], Part], count: int, size: int) -> Iterator[Part]:
    """Yield what `of_part` makes of each part of `count` draws and its number, in order, on all cores.

    Parts have `size` draws. The models let other threads run meanwhile. So does linear algebra, whose own
    threads would compete with these: it has one for each. What a part draws must depend on its number alone.
    """
    parts = [slice(first, first + size) for first in range(0, count, size)]
    with one_blas_thread(), ThreadPoolExecutor(os.cpu_count()) as pool:
        yield from pool.map(of_part, parts, range(len(parts)))
