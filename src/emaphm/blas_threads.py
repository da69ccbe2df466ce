"""Limit of linear algebra to one thread: for the small matrices of a diagnosis, further threads only wait."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class _ThreadLimit:
    """The thread limit of this process, active while it has users."""

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
        """Return the loaded BLAS libraries; they are searched again only after further imports."""
        from threadpoolctl import ThreadpoolController

        if len(sys.modules) != self._modules:
            self._libraries, self._modules = ThreadpoolController(), len(sys.modules)
        return self._libraries

    def leave(self) -> None:
        with self._lock:
            self._users -= 1
            if not self._users:
                self._held.restore_original_limits()


_LIMIT = _ThreadLimit()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit linear algebra to one thread, as a context manager or a decorator.

    A second thread waits for work most of the time and occupies a core while it waits: it increases the
    processor time of a diagnosis by a factor of 1.6, and on a busy machine also its wall time by a factor of
    1.5. The limit applies to the whole process until its last user leaves. The first user searches the loaded
    libraries (those of NumPy and SciPy, for instance), which takes a millisecond, compared with two for an
    answer of a network. The search is repeated only after another module has been imported.
    """
    _LIMIT.enter()
    try:
        yield
    finally:
        _LIMIT.leave()
