"""Workers forked with loaded modules, for tests that do not check the start of workers."""

import multiprocessing
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from emaphm.execution import one_process, processes

LOADED = (
    *("emaphm.diagnosis", "emaphm.fleet", "emaphm.monitoring", "emaphm.prognosis", "emaphm.report"),
    *("emaphm.study", "pytest"),
)
"""Modules whose loading takes most of the start of a worker."""


@contextmanager
def warm_processes() -> Iterator[None]:
    """Fork each worker from a process that has loaded `LOADED`, instead of starting a new Python.

    This takes a twentieth of the time. The normal start is tested in `tests/execution`, and in all tests
    that run the command as a process.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([*LOADED])
    first = context.Process(target=int)  # waits for the loading, so that no timed test waits
    first.start()
    first.join()
    with pytest.MonkeyPatch.context() as patched:
        for module in (one_process, processes):
            patched.setattr(module, "multiprocessing", SimpleNamespace(get_context=lambda _: context))
        yield
