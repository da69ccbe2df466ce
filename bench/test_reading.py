"""Reading of a recording: by the reused process for Parquet files, by a new process, and in this process."""

from pathlib import Path
from typing import Any

import pytest

import emaphm as ema
from bench.conftest import Report
from emaphm.recording.io.limits import ReadLimits
from emaphm.recording.io.reader_process import ReaderProcess

THESIS = ema.Actuator.thesis()
NAMES = ("time_s", "command_rad", "current_A", "voltage_V")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a recording in both formats."""
    folder = tmp_path_factory.mktemp("reading")
    recording = ema.simulate(THESIS, ema.Chirp(), noise=0.05)
    for ending in ("csv", "parquet"):
        ema.write_recording(
            ema.Recording({name: recording[name] for name in NAMES}), folder / f"rec.{ending}"
        )
    return folder


def test_csv(benchmark: Any, report: Report, folder: Path) -> None:
    benchmark(ema.read_recording, folder / "rec.csv", THESIS)
    report("read a CSV file", budget="-")


@pytest.mark.parametrize("isolated", [True, False], ids=["kept process", "this process"])
def test_parquet(benchmark: Any, report: Report, folder: Path, isolated: bool) -> None:
    limits = ReadLimits(isolated=isolated)
    ema.read_recording(folder / "rec.parquet", THESIS, limits=limits)
    benchmark(ema.read_recording, folder / "rec.parquet", THESIS, limits=limits)
    report(f"read a Parquet file, {'by the kept process' if isolated else 'in this process'}", budget="-")


def test_parquet_by_a_new_process(benchmark: Any, report: Report, folder: Path) -> None:
    def read() -> None:
        process = ReaderProcess()
        process.read("parquet", folder / "rec.parquet", ReadLimits(), ())
        process.end()

    benchmark.pedantic(read, rounds=7)
    report("read a Parquet file, by a new process", budget="-")
