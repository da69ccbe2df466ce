"""Fixtures of a server with a small fleet in this process; skipped if its libraries are missing."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("fastapi", reason="needs the extra 'server'")
pytest.importorskip("httpx2", reason="needs httpx2, of the extra 'dev'")

from emaphm.actuator import Actuator
from emaphm.server.app import create_app
from emaphm.server.run import running
from emaphm.server.settings import SETTINGS
from history.unsynced import unsynced

from .made_up import fill

if TYPE_CHECKING:
    from collections.abc import Iterator

    from starlette.testclient import TestClient

    from emaphm.server.state import ServerState

UNITS = 12
SMALL = replace(SETTINGS, workers=1, upload_bytes=300_000, most_waiting=3, units_a_page=8, quiet_seconds=0.0)
WITHOUT_WORKERS = replace(SMALL, workers=0)


@pytest.fixture(scope="module", autouse=True)
def _unsynced() -> "Iterator[None]":
    with unsynced():
        yield


@pytest.fixture(scope="session")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a history of twelve units, to which no test may write."""
    file = tmp_path_factory.mktemp("fleet") / "fleet.sqlite"
    fill(file, UNITS)
    return file


@pytest.fixture
def fleet(filled: Path, tmp_path: Path) -> Path:
    """Return a copy of the history of twelve units, to which a test may write."""
    copied = tmp_path / "fleet.sqlite"
    copied.write_bytes(filled.read_bytes())
    return copied


@pytest.fixture
def state(fleet: Path) -> "Iterator[ServerState]":
    """Yield the state of a server without workers: uploads wait, and prognoses are not renewed."""
    with running(str(fleet), None, None, {"thesis": Actuator.thesis()}, WITHOUT_WORKERS) as shared_state:
        yield shared_state


@pytest.fixture
def client(state: "ServerState") -> "TestClient":
    """Return a client that calls the server without a network."""
    return client_of(state)


@pytest.fixture(scope="module")
def unchanged(filled: Path, tmp_path_factory: pytest.TempPathFactory) -> "Iterator[ServerState]":
    """Yield the state of one server for all tests of a module that change nothing."""
    copied = tmp_path_factory.mktemp("unchanged") / "fleet.sqlite"
    copied.write_bytes(filled.read_bytes())
    with running(str(copied), None, None, {"thesis": Actuator.thesis()}, WITHOUT_WORKERS) as shared_state:
        yield shared_state


@pytest.fixture(scope="module")
def reader(unchanged: "ServerState") -> "TestClient":
    """Return a client of that server, for tests that only read."""
    return client_of(unchanged)


def client_of(state: "ServerState", *, only_loopback: bool = True) -> "TestClient":
    """Return a client of the server with this state."""
    from starlette.testclient import TestClient

    return TestClient(
        create_app(state, only_loopback=only_loopback), "http://127.0.0.1:8000", follow_redirects=False
    )
