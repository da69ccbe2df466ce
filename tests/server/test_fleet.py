"""The fleet in memory: many ask for it at once, and its prognoses are renewed."""

import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from emaphm.history import Entry, History, Mistake
from emaphm.server import fleet as room
from emaphm.server.fleet import FleetRow, FleetView
from emaphm.server.work.queue import AGAIN, FAILED, REFUSED

from .conftest import UNITS
from .made_up import diagnosis, recording


def test_what_is_added_while_another_looks_is_shown(fleet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, go_on = threading.Event(), threading.Event()
    make = room._row

    def slow(*arguments: Any) -> FleetRow:
        made = make(*arguments)
        if not begun.is_set():
            begun.set()
            assert go_on.wait(60)
        return made

    monkeypatch.setattr(room, "_row", slow)
    with History.open(str(fleet)) as history, ThreadPoolExecutor() as threads:
        view = FleetView(history)
        first = threads.submit(view.fleet)
        assert begun.wait(60)
        held = recording(1000)
        history.add(Entry("SN-new", "EMA-9", 5.0), held, diagnosis(held, 0.3))
        second = threads.submit(view.fleet)
        threading.Timer(0.2, go_on.set).start()
        counts = [len(one.result().rows) for one in (first, second)]
        assert counts == [UNITS, UNITS + 1]
        assert len(view.fleet().rows) == UNITS + 1


def test_what_is_withdrawn_is_shown_no_longer(fleet: Path) -> None:
    with History.open(str(fleet)) as history:
        view = FleetView(history)
        held = recording(1000)
        history.add(Entry("SN-new", "EMA-9", 5.0), held, diagnosis(held, 0.3))
        assert len(view.fleet().rows) == UNITS + 1
        history.withdraw("SN-new", Mistake("recording", 5.0, "typo"))
        # A database may give the new rows the numbers of those that are gone.
        history.add(Entry("SN-newer", "EMA-9", 7.0), held, diagnosis(held, 0.3))
        shown = {row.unit: row.hours for row in view.fleet().rows}
        assert "SN-new" not in shown
        assert shown["SN-newer"] == 7.0


def test_a_prognosis_that_is_to_be_tried_again_is_out_of_date_again(fleet: Path) -> None:
    with History.open(str(fleet)) as history:
        view = FleetView(history)
        assert view.outdated() is None
        held = recording(1000)
        history.add(Entry("SN-new", "EMA-9", 5.0), held, diagnosis(held, 0.3))
        found = []
        for state in (AGAIN, REFUSED, FAILED):
            found.append(view.outdated())
            view.forecast("SN-new", state)
        assert found == ["SN-new", "SN-new", None]
