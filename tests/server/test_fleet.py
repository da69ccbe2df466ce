"""The fleet in memory under concurrent requests, and the selection of prognoses to renew."""

import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from emaphm.history import Entry, History, Mistake
from emaphm.server import fleet as fleet_module
from emaphm.server.fleet import FleetRow, FleetView
from emaphm.server.work.queue import AGAIN, FAILED, REFUSED

from .conftest import UNITS
from .made_up import diagnosis, recording


def test_a_unit_added_during_another_request_is_shown(fleet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, go_on = threading.Event(), threading.Event()
    make = fleet_module._row

    def slow(*arguments: Any) -> FleetRow:
        row = make(*arguments)
        if not begun.is_set():
            begun.set()
            assert go_on.wait(60)
        return row

    monkeypatch.setattr(fleet_module, "_row", slow)
    with History.open(str(fleet)) as history, ThreadPoolExecutor() as threads:
        view = FleetView(history)
        first = threads.submit(view.fleet)
        assert begun.wait(60)
        held = recording(1000)
        history.add(Entry("SN-new", "EMA-9", 5.0), held, diagnosis(held, 0.3))
        second = threads.submit(view.fleet)
        threading.Timer(0.2, go_on.set).start()
        counts = [len(future.result().rows) for future in (first, second)]
        assert counts == [UNITS, UNITS + 1]
        assert len(view.fleet().rows) == UNITS + 1


def test_a_withdrawn_unit_is_not_shown(fleet: Path) -> None:
    with History.open(str(fleet)) as history:
        view = FleetView(history)
        held = recording(1000)
        history.add(Entry("SN-new", "EMA-9", 5.0), held, diagnosis(held, 0.3))
        assert len(view.fleet().rows) == UNITS + 1
        history.withdraw("SN-new", Mistake("recording", 5.0, "typo"))
        # A database may reuse the numbers of deleted rows.
        history.add(Entry("SN-newer", "EMA-9", 7.0), held, diagnosis(held, 0.3))
        shown = {row.unit: row.hours for row in view.fleet().rows}
        assert "SN-new" not in shown
        assert shown["SN-newer"] == 7.0


def test_a_postponed_prognosis_is_due_again_and_a_refused_one_is_not(fleet: Path) -> None:
    with History.open(str(fleet)) as history:
        view = FleetView(history)
        assert view.outdated() is None
        held = recording(1000)
        history.add(Entry("SN-new", "EMA-9", 5.0), held, diagnosis(held, 0.3))
        outdated = []
        for state in (AGAIN, REFUSED, FAILED):
            outdated.append(view.outdated())
            view.forecast("SN-new", state)
        assert outdated == ["SN-new", "SN-new", None]
