"""The pool of processes: what it does when something fails."""

import logging
import threading
from pathlib import Path

import pytest

from emaphm.server.folders import ServerFolder
from emaphm.server.work import pool as room
from emaphm.server.work.pool import Pool
from emaphm.server.work.queue import Queue
from emaphm.server.work.worker import Place

from .conftest import SMALL


def test_a_thread_that_meets_a_defect_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(room, "IDLE_S", 0.01)
    asked_again, defects = threading.Event(), iter([RuntimeError("a defect")])

    def spare() -> None:
        for defect in defects:
            raise defect
        asked_again.set()

    queue = Queue(tmp_path / "queue.sqlite")
    pool = Pool(queue, Place("", ServerFolder(tmp_path), {}, 2**33, 2**26), SMALL, spare, lambda *_: None)
    with caplog.at_level(logging.ERROR):
        pool.start()
        found = asked_again.wait(10)
        pool.stop()
    queue.close()
    assert found
    assert "RuntimeError: a defect" in caplog.text  # with its traceback
