"""Processes that read files for this one, one file after another: what crashes such a process is the file's.

Starting Python and a format's library takes 0.3 s, reading a recording some milliseconds.
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
"""Longest list of columns and complaints that a process may answer with [bytes]."""

KEPT_UP_TO = 10_000_000
"""Most numbers of a file after which its process is kept: a library may keep memory that it took for more."""


class ReaderEndedError(Exception):
    """The process ended without an answer, by itself."""


class ReaderTookTooLongError(Exception):
    """The process was ended: its time was up."""


class ReaderProcess:
    """A process that runs `foreign_columns`, and answers one request at a time."""

    def __init__(self) -> None:
        # What the process imports is what this one would; never what lies in the current folder.
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
        """Return what `foreign_columns.read` does; the process is of no more use after the last two errors.

        Raises
        ------
        UnreadableError
            The library refuses the file.
        ReaderEndedError, ReaderTookTooLongError
            There is no answer.
        """
        request = {
            "kind": kind,
            "path": str(path.absolute()),
            "most": [limits.rows, limits.columns, limits.numbers],
            "memory_bytes": limits.memory_bytes,
            "seconds": limits.seconds,
            "wanted": sorted(wanted),
        }
        late = Event()  # this request's: one that came with the answer to the last says nothing of this
        clock = Timer(limits.seconds, self._stop, (late,))
        clock.start()
        try:
            answer, numbers = self._answered(request)
        except ReaderEndedError:
            if late.is_set():
                raise ReaderTookTooLongError from None
            raise
        finally:
            clock.cancel()
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

    def _answered(self, request: dict[str, Any]) -> tuple[dict[str, Any], bytes]:
        try:
            self._requests.write(json.dumps(request).encode() + b"\n")
            self._requests.flush()
        except OSError:  # it has ended already
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

    def _stop(self, late: Event) -> None:
        late.set()
        self._process.kill()

    def end(self) -> None:
        """End the process, and wait until it has."""
        self._process.kill()
        self._answers.close()
        with suppress(OSError):  # of a request that found no reader any more
            self._requests.close()
        self._process.wait()


_idle: dict[int, list[ReaderProcess]] = {}
"""Processes that wait for a file, by the process that started them: one that is forked has none yet."""


def read_by_process(kind: str, path: Path, limits: ReadLimits, wanted: Collection[str]) -> Held:
    """Return what `foreign_columns.read` does, by a process that was kept, or a new one.

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
    # None may be idle. One that was kept may have ended by this file, or before: a new process will show.
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
