"""A function in its own process: results, errors, and death of the process."""

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
"""A program that first calls a function in its own process and does not end this process."""


def die() -> None:
    """End the process as a segmentation fault does."""
    os.kill(os.getpid(), signal.SIGSEGV)


def refuse(name: str) -> None:
    """Raise an error that a user can correct."""
    raise RecordingError(f"{name}: is no recording")


@pytest.fixture(scope="module")
def calls() -> Iterator[Calls]:
    calls_ = Calls(5.0, 2 * GIB)
    yield calls_
    calls_.end()


def test_results_and_errors_come_back_from_one_process(calls: Calls) -> None:
    assert calls(os.getpid) == calls(os.getpid) != os.getpid()
    assert calls(sorted, [2, 1], reverse=False) == [1, 2]
    with pytest.raises(RecordingError, match=r"a.csv: is no recording") as caught:
        calls(refuse, "a.csv")
    assert "in refuse" in str(caught.value.__cause__)


def test_a_death_is_reported_and_the_next_call_is_answered(calls: Calls) -> None:
    with pytest.raises(EndedError, match="SIGSEGV"):
        calls(die)
    assert calls(sorted, [2, 1]) == [1, 2]


def test_interrupt_and_termination_signals_do_not_end_the_process(calls: Calls) -> None:
    child = calls(os.getpid)
    for number in (signal.SIGINT, signal.SIGTERM):
        os.kill(child, number)
        assert calls(os.getpid) == child


def test_a_starting_process_ignores_group_signals_and_ends_with_the_program(
    tmp_path: Path,
) -> None:
    (tmp_path / "program.py").write_text(UNENDED)
    done = subprocess.run(
        [sys.executable, "program.py"], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout == f"{[int(signal.SIGINT), int(signal.SIGTERM)]}\n"
    assert done.stderr == ""


def test_the_memory_of_the_process_is_limited(calls: Calls) -> None:
    with pytest.raises(MemoryError):
        calls(bytearray, 4 * GIB)


def test_a_call_that_takes_too_long_is_ended() -> None:
    calls = Calls(0.3, 2 * GIB)
    with pytest.raises(EndedError, match=r"longer than 0.3 s"):
        calls(time.sleep, 60.0)
    calls.end()


def test_a_death_while_the_caller_stops_is_not_attributed_to_the_function() -> None:
    stop = threading.Event()
    calls = Calls(60.0, 2 * GIB, stop, last_s=60.0)
    stop.set()
    with pytest.raises(StoppedError):
        calls(die)
    calls.end()


def test_a_caller_that_must_stop_waits_for_a_short_total_time() -> None:
    stop = threading.Event()
    calls = Calls(60.0, 2 * GIB, stop, last_s=0.8)
    child = calls(os.getpid)
    threading.Timer(0.1, stop.set).start()
    began = time.monotonic()
    calls(time.sleep, 0.4)  # done within the remaining time
    with pytest.raises(StoppedError):
        calls(time.sleep, 60.0)
    assert time.monotonic() - began < 3.0
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)
    calls.end()
