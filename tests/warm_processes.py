"""Workers that have loaded what they need before they start, where their start is not what is tested."""

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
"""What workers of this machine spend most of their start on."""


@contextmanager
def warm_processes() -> Iterator[None]:
    """Let each worker be forked from a process that has loaded `LOADED`, instead of starting from nothing.

    It takes a twentieth of the time. How they start without it is tested in `tests/execution`, and wherever
    the command runs as a process.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([*LOADED])
    first = context.Process(target=int)  # it waits for the loading, so that none that is timed does
    first.start()
    first.join()
    with pytest.MonkeyPatch.context() as patched:
        for module in (one_process, processes):
            patched.setattr(module, "multiprocessing", SimpleNamespace(get_context=lambda _: context))
        yield
