"""A server that is to end during a long or hanging job ends, and the job waits for the next server."""

import io
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from emaphm.cli import main
from emaphm.server.work import worker
from emaphm.server.work.queue import WAITING, Queue
from monitoring import stand_in
from processes import lives
from waiting import signal_once, wait_for

from .process import Client, address, family, over, started

HANGING = """
import sys, time
from pathlib import Path
from emaphm.cli import main

def hangs(recording, actuator, *, seed, **_):
    Path("begun").touch()
    time.sleep(600)

if __name__ == "__main__":
    from emaphm.server.work import pool
    pool.IDLE_S = 0.05  # its thread sees within this time that the server is to end
    sys.exit(main(sys.argv[1:]))
else:  # a process of the server, which reads this file
    import emaphm.diagnosis
    emaphm.diagnosis.diagnose = hangs
"""
"""`emaphm` with a diagnosis that takes ten minutes."""


@pytest.mark.usefixtures("warm_workers")
def test_a_server_ends_within_seconds_and_the_next_one_does_its_job(
    fleet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (fleet.parent / "hanging.py").write_text(HANGING)
    server = started([sys.executable, "hanging.py"], fleet, "--workers", "1")
    recording = stand_in.content(1, 1).encode()
    status, answer = server.send("a.csv", recording, {"unit": "N", "hours": "1", "actuator": "thesis"})
    assert status == 202
    wait_for((fleet.parent / "begun").exists)
    processes = family(server.process.pid)
    assert len(processes) > 1
    start = time.monotonic()
    os.killpg(server.process.pid, signal.SIGTERM)  # to all its processes, as systemd does
    assert server.process.wait(60) == 0
    assert time.monotonic() - start < 10.0  # of 600
    assert server.process.stdout is not None
    server.process.stdout.close()
    wait_for(lambda: not any(lives(process) for process in processes[1:]))
    with closing(Queue(fleet.with_name(f"{fleet.name}.serve") / "queue.sqlite")) as queue:
        assert [(job.state, job.kills) for job in queue.jobs(9)] == [(WAITING, 0)]

    monkeypatch.setattr("emaphm.server.work.pool.work", _quick_work)
    code, job = _served_here(fleet, monkeypatch, lambda client: over(client, answer["id"]))
    assert (code, job["state"]) == (130, "done")


def _quick_work(*arguments: Any) -> None:
    """Run a worker of the server with a stand-in for the diagnosis."""
    import emaphm.diagnosis

    def diagnosed(recording: Any, actuator: Any, *, seed: int, **_: object) -> object:
        return stand_in.diagnosed(recording, actuator, seed=seed)

    emaphm.diagnosis.diagnose = diagnosed  # type: ignore[assignment]
    worker._write_report = lambda *_: None
    worker.work(*arguments)


def _served_here(
    fleet: Path, monkeypatch: pytest.MonkeyPatch, ask: Callable[[Client], Any]
) -> tuple[int, Any]:
    """Run `emaphm serve` in this process until `ask` has returned; return the exit code and its answer."""
    output, answers = io.StringIO(), list[Any]()

    def asking() -> None:
        answers.append(ask(Client(address(output.getvalue()))))

    with (
        monkeypatch.context() as patched,
        signal_once(signal.SIGINT, lambda: "\n" in output.getvalue(), asking),
    ):
        patched.setattr(sys, "stdout", output)
        code = main(["serve", "--db", str(fleet), "--port", "0", "--json", "--workers", "1"])
    return code, answers[0]
