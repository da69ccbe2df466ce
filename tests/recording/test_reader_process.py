"""Processes that read files: reused for the next file, and replaced when they have ended or hang."""

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from emaphm.arrays import Array
from emaphm.recording.io import foreign_columns, reader_process
from emaphm.recording.io.limits import ReadLimits
from emaphm.recording.io.reader_process import (
    ReaderEndedError,
    ReaderProcess,
    ReaderTookTooLongError,
    read_by_process,
)

Idle = list[ReaderProcess]


@pytest.fixture
def idle(monkeypatch: pytest.MonkeyPatch) -> Iterator[Idle]:
    """Return the list of idle processes, empty at first."""
    readers: Idle = []
    monkeypatch.setattr(reader_process, "_idle", {os.getpid(): readers})
    yield readers
    for reader in readers:
        reader.end()


def saved(folder: Path, number: int) -> Path:
    path = folder / f"{number}.parquet"
    pl.DataFrame({"x": [float(number)] * 5, "y": np.arange(5.0)}).write_parquet(path)
    return path


def read(path: Path, limits: ReadLimits = ReadLimits()) -> Array:  # noqa: B008 - it is frozen
    return np.asarray(read_by_process("parquet", path, limits, ()).numeric["x"])


def number_of(reader: ReaderProcess) -> int:
    return reader._process.pid


def test_one_process_reads_file_after_file(tmp_path: Path, idle: Idle) -> None:
    numbers = set()
    for number in range(3):
        assert read(saved(tmp_path, number)).tolist() == [number] * 5
        numbers |= {number_of(reader) for reader in idle}
    assert len(numbers) == 1


def test_a_process_that_ended_is_replaced(tmp_path: Path, idle: Idle) -> None:
    path = saved(tmp_path, 1)
    read(path)
    idle[0]._process.kill()  # as the system may do if memory is short
    assert read(path).tolist() == [1] * 5
    assert len(idle) == 1


def test_an_abort_is_reported_after_a_new_process_aborted_too(
    tmp_path: Path, idle: Idle, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, script = saved(tmp_path, 1), tmp_path / "aborting.py"
    script.write_text("import os, sys\nsys.stdin.readline()\nos.abort()\n")
    with monkeypatch.context() as changed:
        changed.setattr(foreign_columns, "__file__", str(script))
        idle.append(ReaderProcess())
        with pytest.raises(ReaderEndedError):
            read(path)
    assert not idle
    assert read(path).tolist() == [1] * 5


def test_a_process_that_takes_too_long_is_ended(
    tmp_path: Path, idle: Idle, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, script = saved(tmp_path, 1), tmp_path / "hanging.py"
    script.write_text("import time\ntime.sleep(600)\n")
    with monkeypatch.context() as changed:
        changed.setattr(foreign_columns, "__file__", str(script))
        idle.append(ReaderProcess())
        with pytest.raises(ReaderTookTooLongError):
            read(path, ReadLimits(seconds=0.05))
    assert not idle
    assert read(path).tolist() == [1] * 5


def test_each_thread_reads_with_its_own_process(tmp_path: Path, idle: Idle) -> None:
    paths = [saved(tmp_path, number) for number in range(12)]
    with ThreadPoolExecutor(2) as pool:
        columns = list(pool.map(read, paths))
    assert [values[0] for values in columns] == list(range(12))
    assert 1 <= len(idle) <= 2


def test_a_process_that_read_a_large_file_is_not_reused(
    tmp_path: Path, idle: Idle, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reader_process, "KEPT_UP_TO", 9)
    assert read(saved(tmp_path, 7)).tolist() == [7] * 5
    assert not idle


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no processes are forked here")
def test_a_forked_process_has_its_own_reader_processes(tmp_path: Path, idle: Idle) -> None:
    path, answer = saved(tmp_path, 4), tmp_path / "answer"
    read(path)
    child = os.fork()
    if child == 0:
        answer.write_text(str(read(path)[0]))
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
    assert answer.read_text() == "4.0"
    assert len(idle) == 1
    assert read(path).tolist() == [4] * 5
