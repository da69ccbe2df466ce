"""Separate reader processes, each of which reads one file after another and may crash on a damaged file.

A process is kept for the next file: starting Python and a format's library takes 0.3 s, reading a recording a
few milliseconds.
"""

import atexit
import json
import os
import subprocess
import sys
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from threading import Event, Timer
from typing import Any

import numpy as np

from emaphm.recording.io import foreign_columns
from emaphm.recording.io.foreign_columns import Held, UnreadableError
from emaphm.recording.io.limits import ReadLimits

LONGEST_HEADER = 64 * 2**20
"""Longest list of columns and complaints in an answer [bytes]."""

KEPT_UP_TO = 10_000_000
"""Largest file [numbers] after which its process is kept: a library may not release the memory of a larger
file."""


class ReaderEndedError(Exception):
    """The process ended by itself without an answer."""


class ReaderTookTooLongError(Exception):
    """The process was ended because it exceeded its time."""


class ReaderProcess:
    """A process that runs `foreign_columns` and answers one request at a time."""

    def __init__(self) -> None:
        # The process imports the same modules as this process, and none from the current folder.
        environment = os.environ | {
            "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
            "POLARS_MAX_THREADS": "2",
        }
        self._process = subprocess.Popen(  # noqa: S603 - this Python, on a file of this package
            [sys.executable, "-P", foreign_columns.__file__],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment,
        )  # fmt: skip
        self._requests: Any = self._process.stdin
        self._answers: Any = self._process.stdout

    def read(self, kind: str, path: Path, limits: ReadLimits, wanted: Collection[str]) -> Held:
        """Return the columns that `foreign_columns.read` returns in the process.

        Raises
        ------
        UnreadableError
            The library refuses the file.
        ReaderEndedError, ReaderTookTooLongError
            There is no answer; the process cannot be used again.
        """
        request = {
            "kind": kind,
            "path": str(path.absolute()),
            "most": [limits.rows, limits.columns, limits.numbers],
            "memory_bytes": limits.memory_bytes,
            "seconds": limits.seconds,
            "wanted": sorted(wanted),
        }
        timed_out = Event()  # a new one for each request: an old timer must not affect this request
        timer = Timer(limits.seconds, self._stop, (timed_out,))
        timer.start()
        try:
            answer, numbers = self._answer(request)
        except ReaderEndedError:
            if timed_out.is_set():
                raise ReaderTookTooLongError from None
            raise
        finally:
            timer.cancel()
        if "error" in answer:
            raise UnreadableError(answer["error"])
        ends = np.cumsum(answer["lengths"], dtype=int)
        arrays = np.split(np.frombuffer(numbers, float), ends[:-1])
        return Held(
            answer["rows"],
            answer["columns"],
            {name: arrays[place] for name, place in answer["numeric"].items()},
            answer["unusable"],
            {name: (distinct, arrays[place]) for name, (distinct, place) in answer["texts"].items()},
            {name: arrays[place] for name, place in answer["times"].items()},
        )

    def _answer(self, request: dict[str, Any]) -> tuple[dict[str, Any], bytes]:
        try:
            self._requests.write(json.dumps(request).encode() + b"\n")
            self._requests.flush()
        except OSError:  # the process has already ended
            raise ReaderEndedError from None
        header = self._answers.readline(LONGEST_HEADER)
        if not header.endswith(b"\n"):
            raise ReaderEndedError
        answer = json.loads(header)
        size = 8 * sum(answer.get("lengths", ()))
        numbers = self._answers.read(size)
        if len(numbers) < size:
            raise ReaderEndedError
        return answer, numbers

    def _stop(self, timed_out: Event) -> None:
        timed_out.set()
        self._process.kill()

    def end(self) -> None:
        """End the process and wait for its end."""
        self._process.kill()
        self._answers.close()
        with suppress(OSError):  # a buffered request whose reader has ended
            self._requests.close()
        self._process.wait()


_idle: dict[int, list[ReaderProcess]] = {}
"""Idle reader processes by the process that started them: a forked process begins without any."""


def read_by_process(kind: str, path: Path, limits: ReadLimits, wanted: Collection[str]) -> Held:
    """Return the columns that `foreign_columns.read` returns, in an idle process or a new one.

    Raises
    ------
    UnreadableError
        The library refuses the file.
    ReaderEndedError, ReaderTookTooLongError
        There is no answer.
    OSError
        No process can be started.
    """
    idle = _idle.setdefault(os.getpid(), [])
    # There may be no idle process, or it may have ended, before or because of this file: then a new process
    # reads the file.
    with suppress(IndexError, ReaderEndedError):
        return _read_by(idle.pop(), kind, path, limits, wanted)
    return _read_by(ReaderProcess(), kind, path, limits, wanted)


def _read_by(
    reader: ReaderProcess, kind: str, path: Path, limits: ReadLimits, wanted: Collection[str]
) -> Held:
    keep = False
    try:
        held = reader.read(kind, path, limits, wanted)
        keep = held.rows * held.columns <= KEPT_UP_TO
    finally:
        if keep:
            _idle[os.getpid()].append(reader)
        else:
            reader.end()
    return held


@atexit.register
def _end_idle() -> None:
    for reader in _idle.pop(os.getpid(), ()):
        reader.end()
