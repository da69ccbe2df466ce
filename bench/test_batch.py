"""Many recordings in one command: time per recording on one and two cores, and peak memory."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import emaphm as ema
from bench.conftest import Report
from emaphm.study import cases
from emaphm.study.record import recorded
from emaphm.study.rig import Manoeuvre, Rig

RECORDINGS = 32
"""One takes up to three times another's time, and starting the processes some seconds of all."""

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
"""A command that says in the end what memory it had at most, itself and the largest of its workers.

Its own is not from `getrusage`: that keeps the size of the process that it was forked from.
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of recordings of the default manoeuvre, each with other faults."""
    made = tmp_path_factory.mktemp("recordings")
    actuator, rig = ema.Actuator.thesis(), Rig(label="base setting", channels=("current_A", "voltage_V"))
    for seed in range(RECORDINGS):
        recording = recorded(rig, actuator, Manoeuvre(), cases.random_faults(seed), seed)
        ema.write_recording(recording, made / f"{seed:02}.csv")
    return made


@pytest.mark.parametrize(("workers", "budget"), [(1, "≥ 1 ×"), (2, "≥ 1.7 ×")])
def test_batch(
    benchmark: Any, report: Report, folder: Path, tmp_path: Path, workers: int, budget: str
) -> None:
    script = tmp_path / "measured.py"
    script.write_text(MEASURED, encoding="utf-8")
    command = [sys.executable, str(script), str(folder), str(workers)]
    done = benchmark.pedantic(
        subprocess.run, (command,), {"check": True, "capture_output": True, "text": True}, rounds=3
    )
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["code"] == 0
    own, worker = told["peaks_MB"]
    memory = f"{own:.0f} MB" + (f" and {worker:.0f} MB a worker" if workers > 1 else "")
    report(f"a recording of {RECORDINGS}, {workers} workers, peak {memory}", budget=budget, runs=RECORDINGS)
