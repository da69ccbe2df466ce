"""A server that is asked to end while a job is long or hangs: it ends, and the job waits for the next one."""

import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

from monitoring import stand_in

from .process import ROOT, Server, family, over, started

HANGING = f"""
import sys, time
from pathlib import Path
sys.path.append({str(ROOT / "tests")!r})
import emaphm.diagnosis
from emaphm.cli import main
from emaphm.server.work import worker
from monitoring import stand_in

def diagnosed(recording, actuator, *, seed, **_):
    if Path("hang").exists():
        Path("begun").touch()
        time.sleep(600)
    return stand_in.diagnosed(recording, actuator, seed=seed)

# In the processes of the server too, which read this file.
emaphm.diagnosis.diagnose = diagnosed
worker._write_report = lambda *_: None
if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
"""
"""`emaphm` with a stand-in for the diagnosis, which hangs as long as there is a file "hang"."""


def test_it_ends_within_seconds_and_its_job_is_done_by_the_next(fleet: Path) -> None:
    (fleet.parent / "hanging.py").write_text(HANGING)
    (fleet.parent / "hang").touch()
    server = _served(fleet)
    recording = stand_in.content(1, 1).encode()
    status, answer = server.send("a.csv", recording, {"unit": "N", "hours": "1", "actuator": "thesis"})
    assert status == 202
    _wait_for((fleet.parent / "begun").exists)
    every = family(server.process.pid)
    assert len(every) > 1
    began = time.monotonic()
    _end(server, signal.SIGTERM, 0)
    assert time.monotonic() - began < 10.0  # of 600
    _wait_for(lambda: not any(Path(f"/proc/{one}").exists() for one in every[1:]))

    (fleet.parent / "hang").unlink()
    again = _served(fleet)
    try:
        assert over(again, answer["id"])["state"] == "done"
    finally:
        _end(again, signal.SIGINT, 130)


def _end(server: Server, number: int, code: int) -> None:
    server.process.send_signal(number)
    assert server.process.wait(60) == code
    assert server.process.stdout is not None
    server.process.stdout.close()


def _served(fleet: Path) -> Server:
    return started([sys.executable, "hanging.py"], fleet, "--workers", "1")


def _wait_for(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)
