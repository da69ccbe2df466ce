"""The pool of processes: what it does when something fails."""

import logging
import threading
from pathlib import Path
from typing import Any, cast

import pytest

from emaphm.server.folders import ServerFolder
from emaphm.server.work import pool as room
from emaphm.server.work.pool import Pool
from emaphm.server.work.queue import AGAIN, DONE, FAILED, REFUSED, Queue
from emaphm.server.work.worker import JobOutcome, Place

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


@pytest.mark.parametrize(
    ("ends", "states"),
    [
        ([AGAIN, AGAIN, DONE], [AGAIN, AGAIN, DONE]),
        ([REFUSED], [REFUSED]),
        ([None, None, None], [AGAIN, FAILED, AGAIN]),  # None: the process has died
        ([None, AGAIN, None], [AGAIN, AGAIN, FAILED]),
    ],
)
def test_a_prognosis_is_tried_again_where_the_history_is_away_and_once_after_a_kill(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ends: list[str | None], states: list[str]
) -> None:
    monkeypatch.setattr(room, "AGAIN_S", 0.0)
    found = []
    queue = Queue(tmp_path / "queue.sqlite")
    place = Place("", ServerFolder(tmp_path), {}, 2**33, 2**26)
    pool = Pool(queue, place, SMALL, lambda: "S1", lambda *ended: found.append(ended))
    for end in ends:
        monkeypatch.setattr(pool, "_outcome", lambda *_, end=end: None if end is None else JobOutcome(end))
        assert pool._next(cast("Any", None))
    queue.close()
    assert found == [("S1", state) for state in states]
