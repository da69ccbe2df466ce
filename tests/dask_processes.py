"""Schedulers and workers of Dask, forked from one process that has loaded their modules."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

PATIENCE_S = 60
"""Time limit for the start of a process on a busy machine."""

TESTS = str(Path(__file__).parent)
"""Folder in which workers find the functions of tests."""

FORKS = """
import json, os, signal, sys
from importlib import import_module
import dask, emaphm.diagnosis, emaphm.fleet, emaphm.study

MAINS = {kind: import_module(f"distributed.cli.dask_{kind}").main for kind in ("scheduler", "worker")}
children = []
for line in sys.stdin:
    order = json.loads(line)
    child = os.fork()
    if not child:
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in range(3):
            os.dup2(nothing, stream)
        os.chdir(order["folder"])
        os.environ.update(order["variables"])
        dask.config.refresh()
        MAINS[order["kind"]](args=order["arguments"], standalone_mode=False)
        sys.exit()
    children.append(child)
    print(child, flush=True)
for child in children:
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
"""
"""Forks schedulers and workers, whose start is mostly loading; Polars must not be used before."""

DOES_NOT_WAIT_LONG = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "5s"}
"""Time for a killed worker: a scheduler requests its last results, by default for 30 s."""

Forks = subprocess.Popen[str]


@dataclass(frozen=True)
class Process:
    """A scheduler or a worker."""

    pid: int

    def kill(self) -> None:
        """Kill the process; a killed process remains until the process that forked it ends."""
        os.kill(self.pid, signal.SIGKILL)


class Cluster:
    """A scheduler and its workers, each in its own process without output."""

    def __init__(self, forks: Forks, folder: Path, **variables: str) -> None:
        self._forks = forks
        self._folder = folder
        self._file = folder / "scheduler.json"
        self.workers: list[Process] = []
        self.scheduler = self._start("scheduler", "--port", "0", **variables)
        deadline = time.monotonic() + PATIENCE_S
        # The scheduler opens the file before it writes its content.
        while not (self._file.exists() and self._file.stat().st_size):
            assert time.monotonic() < deadline
            time.sleep(0.02)
        self.address: str = json.loads(self._file.read_text(encoding="utf-8"))["address"]

    def add_worker(self, *options: str) -> None:
        """Start a worker with one thread, without waiting for it."""
        self.workers.append(self._start("worker", "--no-nanny", "--nthreads", "1", *options))

    def _start(self, kind: str, *options: str, **variables: str) -> Process:
        # No port is fixed, so that several clusters do not collide.
        places = ("--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0", "--no-dashboard")
        arguments = ("--scheduler-file", str(self._file), *places, *options)
        order = {
            "kind": kind,
            "folder": str(self._folder),
            "variables": variables,
            "arguments": arguments,
        }
        assert self._forks.stdin is not None
        assert self._forks.stdout is not None
        self._forks.stdin.write(f"{json.dumps(order)}\n")
        self._forks.stdin.flush()
        return Process(int(self._forks.stdout.readline()))

    def close(self) -> None:
        """End all processes, including processes killed earlier."""
        for process in (*self.workers, self.scheduler):
            process.kill()


def with_tests() -> dict[str, str]:
    """Return the environment variable with which a process finds the functions of tests."""
    return {"PYTHONPATH": os.pathsep.join(filter(None, [TESTS, os.environ.get("PYTHONPATH")]))}


@contextmanager
def forking() -> Iterator[Forks]:
    """Yield a process that forks the processes of clusters; it ends with the block."""
    with subprocess.Popen(  # noqa: S603 - the arguments are this file's
        [sys.executable, "-W", "ignore", "-c", FORKS],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | DOES_NOT_WAIT_LONG | with_tests(),
    ) as process:
        yield process
        process.communicate()
