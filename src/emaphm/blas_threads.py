"""Linear algebra on one thread: with matrices as small as those of a diagnosis, further threads only wait."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class _Limit:
    """The limit of this process, held as long as anybody needs it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._users = 0
        self._held: Any = None
        self._libraries: Any = None
        self._modules = 0

    def enter(self) -> None:
        with self._lock:
            if not self._users:
                self._held = self._loaded().limit(limits=1, user_api="blas")
            self._users += 1

    def _loaded(self) -> Any:
        """Return the libraries that are loaded, looked for again where a module was imported since."""
        from threadpoolctl import ThreadpoolController

        if len(sys.modules) != self._modules:
            self._libraries, self._modules = ThreadpoolController(), len(sys.modules)
        return self._libraries

    def leave(self) -> None:
        with self._lock:
            self._users -= 1
            if not self._users:
                self._held.restore_original_limits()


_LIMIT = _Limit()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep linear algebra to one thread, in a block or in a function that this decorates.

    A second thread waits for work most of the time, and takes a core while it waits: a diagnosis needs 1.6
    times the processor time with it, on a machine that does something else also 1.5 times as long. The limit
    is the whole process's, until the last of those leave that asked for it. The first to enter looks for the
    libraries that are loaded by then, NumPy's and SciPy's, say, which takes a millisecond: a network's answer
    takes two. Nobody looks again before another module is imported.
    """
    _LIMIT.enter()
    try:
        yield
    finally:
        _LIMIT.leave()
