"""`python -m bench.many_recordings`: a folder of many recordings, time per recording and peak memory."""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import emaphm as ema
from bench.test_batch import MEASURED
from emaphm.study import cases
from emaphm.study.record import recorded
from emaphm.study.rig import Manoeuvre, Rig

DISTINCT = 50
"""Recordings that are simulated; the others are copies with another name."""


def fill(folder: Path, count: int) -> None:
    """Fill a folder with recordings of the base setting, current and line voltage, random faults."""
    actuator, rig = ema.Actuator.thesis(), Rig(label="base setting", channels=("current_A", "voltage_V"))
    contents: list[bytes] = []
    for seed in range(min(count, DISTINCT)):
        path = folder / f"{seed:05}.csv"
        ema.write_recording(recorded(rig, actuator, Manoeuvre(), cases.random_faults(seed), seed), path)
        contents.append(path.read_bytes())
    for i in range(DISTINCT, count):
        (folder / f"{i:05}.csv").write_bytes(contents[i % DISTINCT])


def runs(counts: list[int], workers: list[int]) -> Iterator[str]:
    """Yield a row of the table for each number of recordings and of workers."""
    duration = Manoeuvre().duration
    for count in counts:
        with tempfile.TemporaryDirectory() as place:
            folder, script = Path(place) / "recordings", Path(place) / "measured.py"
            folder.mkdir()
            fill(folder, count)
            script.write_text(MEASURED, encoding="utf-8")
            for number in workers:
                began = time.perf_counter()
                command = [sys.executable, str(script), str(folder), str(number)]
                done = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603 - our own script
                seconds = (time.perf_counter() - began) / count
                measured = json.loads(done.stdout.splitlines()[-1])
                own, worker = measured["peaks_MB"]
                yield (
                    f"| {count:,} | {number} | {seconds:.2f} s | {duration / seconds:.1f} × | {own:.0f} MB | "
                    f"{worker:.0f} MB |"
                )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, nargs="+", default=[100, 1000])
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    given = parser.parse_args()
    print("| recordings | workers | a recording | of real time | memory, at most | of a worker |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: |")
    for row in runs(given.recordings, given.workers):
        print(row, flush=True)


if __name__ == "__main__":
    main()
