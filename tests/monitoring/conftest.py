"""Fixtures for empty histories, and for watchers that poll often."""

import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest

from emaphm.history import History
from history.unsynced import unsynced


@pytest.fixture(scope="module", autouse=True)
def _unsynced() -> Iterator[None]:
    with unsynced():
        yield


@pytest.fixture(autouse=True)
def _looks_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let an idle watcher poll again soon."""
    module = importlib.import_module(
        "emaphm.monitoring.watch"
    )  # the package exports a function of the same name
    monkeypatch.setattr(module, "IDLE_S", 0.01)


@pytest.fixture
def history(tmp_path: Path, new_history: bytes) -> Iterator[History]:
    """Return a new history, in the file `history.sqlite` of the test's folder."""
    file = tmp_path / "history.sqlite"
    file.write_bytes(new_history)
    with History.open(file) as opened:
        yield opened
