"""Many recordings in one command: time per recording on one and two cores, and peak memory."""

from pathlib import Path
from typing import Any

import pytest

from bench.conftest import Report
from bench.many_recordings import fill, peaks_of

RECORDINGS = 32
"""Times of recordings differ by up to a factor of three, and starting the processes takes some seconds."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of recordings of the default manoeuvre with different faults."""
    recordings = tmp_path_factory.mktemp("recordings")
    fill(recordings, RECORDINGS)
    return recordings


@pytest.mark.parametrize(("workers", "budget"), [(1, "≥ 1 ×"), (2, "≥ 1.7 ×")])
def test_batch(
    benchmark: Any, report: Report, folder: Path, tmp_path: Path, workers: int, budget: str
) -> None:
    own, worker = benchmark.pedantic(peaks_of, (folder, workers, tmp_path), rounds=3)
    memory = f"{own:.0f} MB" + (f" and {worker:.0f} MB a worker" if workers > 1 else "")
    report(f"a recording of {RECORDINGS}, {workers} workers, peak {memory}", budget=budget, runs=RECORDINGS)
