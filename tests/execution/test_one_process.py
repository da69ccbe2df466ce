"""A function in a process of its own: what it returns and raises, and that it may die."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from emaphm.errors import RecordingError
from emaphm.execution.one_process import Calls, EndedError, StoppedError

GIB = 2**30

UNENDED = """
import signal
from emaphm.execution.one_process import Calls

def blocked():
    return sorted(map(int, signal.pthread_sigmask(signal.SIG_BLOCK, [])))

if __name__ == "__main__":
    calls = Calls(60.0, 2**31)
    print(calls(blocked))
"""
"""A program that calls a function as the first thing it does, and does not end the process of it."""


def die() -> None:
    """Die, as of a segmentation fault."""
    os.kill(os.getpid(), signal.SIGSEGV)


def refuse(name: str) -> None:
    """Raise what a user can correct."""
    raise RecordingError(f"{name}: is no recording")


@pytest.fixture(scope="module")
def calls() -> Iterator[Calls]:
    made = Calls(5.0, 2 * GIB)
    yield made
    made.end()


def test_results_and_errors_come_back_from_one_process(calls: Calls) -> None:
    assert calls(os.getpid) == calls(os.getpid) != os.getpid()
    assert calls(sorted, [2, 1], reverse=False) == [1, 2]
    with pytest.raises(RecordingError, match=r"a.csv: is no recording") as caught:
        calls(refuse, "a.csv")
    assert "in refuse" in str(caught.value.__cause__)


def test_a_death_is_said_and_the_next_call_is_answered(calls: Calls) -> None:
    with pytest.raises(EndedError, match="SIGSEGV"):
        calls(die)
    assert calls(sorted, [2, 1]) == [1, 2]


def test_signals_that_all_processes_get_do_not_end_it(calls: Calls) -> None:
    child = calls(os.getpid)
    for number in (signal.SIGINT, signal.SIGTERM):
        os.kill(child, number)
        assert calls(os.getpid) == child


def test_the_first_process_is_spared_them_while_it_starts_and_a_program_ends_that_has_not_ended_it(
    tmp_path: Path,
) -> None:
    (tmp_path / "program.py").write_text(UNENDED)
    done = subprocess.run(
        [sys.executable, "program.py"], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout == f"{[int(signal.SIGINT), int(signal.SIGTERM)]}\n"
    assert done.stderr == ""


def test_memory_is_bounded(calls: Calls) -> None:
    with pytest.raises(MemoryError):
        calls(bytearray, 4 * GIB)


def test_what_takes_too_long_is_ended() -> None:
    calls = Calls(0.3, 2 * GIB)
    with pytest.raises(EndedError, match=r"longer than 0.3 s"):
        calls(time.sleep, 60.0)
    calls.end()


def test_a_death_while_the_caller_is_to_stop_is_not_put_down_to_the_function() -> None:
    stop = threading.Event()
    calls = Calls(60.0, 2 * GIB, stop, last_s=60.0)
    stop.set()
    with pytest.raises(StoppedError):
        calls(die)
    calls.end()


def test_a_caller_that_is_to_stop_waits_a_little_in_all() -> None:
    stop = threading.Event()
    calls = Calls(60.0, 2 * GIB, stop, last_s=0.8)
    child = calls(os.getpid)
    threading.Timer(0.1, stop.set).start()
    began = time.monotonic()
    calls(time.sleep, 0.4)  # done within what it has left
    with pytest.raises(StoppedError):
        calls(time.sleep, 60.0)
    assert time.monotonic() - began < 3.0
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)
    calls.end()
