"""The fleet in memory: many ask for it at once."""

import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from emaphm.history import Entry, History
from emaphm.server import fleet as room
from emaphm.server.fleet import FleetRow, FleetView

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
