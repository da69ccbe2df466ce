"""`python -m bench.many_recordings`: time per recording and peak memory for a folder of many recordings."""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import emaphm as ema
from emaphm.study import cases
from emaphm.study.record import recorded
from emaphm.study.rig import Manoeuvre, Rig

DISTINCT = 50
"""Number of simulated recordings; further recordings are copies with other names."""

MEASURED = """\
import json, resource, sys
from pathlib import Path
from emaphm.cli import main
if __name__ == "__main__":
    code = main(["diagnose", sys.argv[1], "--workers", sys.argv[2], "--json"])
    (own,) = [line.split()[1] for line in Path("/proc/self/status").open() if line.startswith("VmHWM")]
    worker = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    print(json.dumps({"code": code, "peaks_MB": [int(own) / 1024, worker / 1024]}))
"""
"""A script that finally prints the peak memory of its process and of its largest worker.

The memory of its process is not from `getrusage`, which keeps the size of the process it was forked from.
"""


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


def peaks_of(folder: Path, workers: int, place: Path) -> tuple[float, float]:
    """Return the peak memory [MB] of a diagnosis of all recordings: of the main process and of a worker.

    The script that measures it is written to the folder `place`.
    """
    script = place / "measured.py"
    script.write_text(MEASURED, encoding="utf-8")
    command = [sys.executable, str(script), str(folder), str(workers)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603 - our own script
    measured = json.loads(done.stdout.splitlines()[-1])
    assert measured["code"] == 0  # noqa: S101 - all recordings must have been diagnosed
    own, worker = measured["peaks_MB"]
    return own, worker


def runs(counts: list[int], workers: list[int]) -> Iterator[str]:
    """Yield a row of the table for each number of recordings and of workers."""
    duration = Manoeuvre().duration
    for count in counts:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place) / "recordings"
            folder.mkdir()
            fill(folder, count)
            for number in workers:
                began = time.perf_counter()
                own, worker = peaks_of(folder, number, Path(place))
                seconds = (time.perf_counter() - began) / count
                yield (
                    f"| {count:,} | {number} | {seconds:.2f} s | {duration / seconds:.1f} × | {own:.0f} MB | "
                    f"{worker:.0f} MB |"
                )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, nargs="+", default=[100, 1000])
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    options = parser.parse_args()
    print("| recordings | workers | a recording | of real time | memory, at most | of a worker |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: |")
    for row in runs(options.recordings, options.workers):
        print(row, flush=True)


if __name__ == "__main__":
    main()
