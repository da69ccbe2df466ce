"""The pool of worker processes after errors, and the repetition of prognoses."""

import logging
import threading
from pathlib import Path
from typing import Any, cast

import pytest

from emaphm.errors import ServerError
from emaphm.execution.one_process import OneProcess
from emaphm.server.folders import ServerFolder
from emaphm.server.work import pool as pool_module
from emaphm.server.work import worker
from emaphm.server.work.pool import Pool
from emaphm.server.work.queue import AGAIN, DONE, FAILED, REFUSED, Queue
from emaphm.server.work.worker import Forecast, JobOutcome, Place, Upload, work

from .conftest import SMALL


def test_a_thread_continues_after_an_unexpected_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(pool_module, "IDLE_S", 0.01)
    asked_again, defects = threading.Event(), iter([RuntimeError("a defect")])

    def spare() -> None:
        for defect in defects:
            raise defect
        asked_again.set()

    queue = Queue(tmp_path / "queue.sqlite")
    pool = Pool(queue, Place("", ServerFolder(tmp_path), {}, 2**33, 2**26), SMALL, spare, lambda *_: None)
    with caplog.at_level(logging.ERROR):
        pool.start()
        continued = asked_again.wait(10)
        pool.stop()
    queue.close()
    assert continued
    assert "RuntimeError: a defect" in caplog.text  # with its traceback


@pytest.mark.parametrize(
    ("ends", "states"),
    [
        ([AGAIN, AGAIN, DONE], [AGAIN, AGAIN, DONE]),
        ([REFUSED], [REFUSED]),
        ([None, None, None], [AGAIN, FAILED, AGAIN]),  # None: the process has died
        ([None, AGAIN, None], [AGAIN, AGAIN, FAILED]),
    ],
)
def test_a_prognosis_is_repeated_while_the_history_is_unavailable_and_once_after_a_kill(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ends: list[str | None], states: list[str]
) -> None:
    monkeypatch.setattr(pool_module, "AGAIN_S", 0.0)
    ended_jobs = []
    queue = Queue(tmp_path / "queue.sqlite")
    place = Place("", ServerFolder(tmp_path), {}, 2**33, 2**26)
    pool = Pool(queue, place, SMALL, lambda: "S1", lambda *ended: ended_jobs.append(ended))
    for end in ends:
        monkeypatch.setattr(pool, "_outcome", lambda *_, end=end: None if end is None else JobOutcome(end))
        assert pool._next(cast("Any", None))
    queue.close()
    assert ended_jobs == [("S1", state) for state in states]


def test_a_job_ends_when_the_disk_of_the_queue_has_space_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pool_module, "AGAIN_S", 0.0)
    queue = Queue(tmp_path / "queue.sqlite")
    for hours in (1.0, 2.0):
        queue.add({"unit": "S1", "hours": hours, "name": "a.csv"}, f"{hours}.csv")
    pool = Pool(
        queue, Place("", ServerFolder(tmp_path), {}, 2**33, 2**26), SMALL, lambda: None, lambda *_: None
    )
    full = iter([ServerError("no space left")] * 2)

    def end(*values: Any, real: Any = queue.end) -> None:
        for error in full:
            raise error
        real(*values)

    monkeypatch.setattr(queue, "end", end)
    monkeypatch.setattr(pool, "_outcome", lambda *_: JobOutcome(DONE))
    monkeypatch.setattr(queue, "_arriving", lambda _: [])
    assert pool._next(cast("Any", None))
    assert pool._next(cast("Any", None))
    states = [job.state for job in queue.jobs(2)]
    queue.close()
    assert states == [DONE, DONE]


def test_a_job_fails_after_an_unexpected_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def defect(*_: Any) -> None:
        raise RuntimeError("a defect in /srv/private")

    queue = Queue(tmp_path / "queue.sqlite")
    queue.add({"unit": "S1", "hours": 1.0, "name": "a.csv"}, "a.csv")
    place = Place("", ServerFolder(tmp_path), {}, 2**33, 2**26)
    pool = Pool(queue, place, SMALL, lambda: None, lambda *_: None)
    monkeypatch.setattr(pool, "_outcome", defect)
    monkeypatch.setattr(queue, "_arriving", lambda _: [])
    process = OneProcess(work)
    assert pool._next(process)
    (ended,) = queue.jobs(1)
    queue.close()
    assert ended.state == FAILED
    assert "unexpected error (RuntimeError)" in ended.message


@pytest.mark.parametrize("job", [Forecast("S1"), Upload(Path("a.csv"), "a.csv", {})])
def test_a_worker_answers_after_an_unexpected_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, job: Upload | Forecast
) -> None:
    def defect(*_: Any) -> None:
        raise PermissionError("/srv/private")

    monkeypatch.setattr(worker, "_executed", defect)
    outcome = worker._outcome(job, Place("", ServerFolder(tmp_path), {}, 2**33, 2**26), cast("Any", None))
    assert outcome.state == FAILED
    assert "unexpected error (PermissionError)" in outcome.message
    assert "PermissionError: /srv/private" in caplog.text  # for the operator, not for clients
    assert "private" not in outcome.message
