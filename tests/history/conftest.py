"""Fixtures for histories in a file and on a PostgreSQL server; tests run on both."""

import os
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest
import sqlalchemy as sa

from emaphm.history import History

from .unsynced import unsynced

SERVER = "EMAPHM_POSTGRESQL"
"""Variable with the URL of a PostgreSQL server that tests may use; `postgresql.sh` starts one."""


@pytest.fixture(scope="module", autouse=True)
def _unsynced() -> Iterator[None]:
    with unsynced():
        yield


def server() -> str:
    """Return the server's URL; skip the test if there is no server."""
    if SERVER not in os.environ:
        pytest.skip(f"no PostgreSQL server: set {SERVER} to its URL (tests/history/postgresql.sh starts one)")
    return os.environ[SERVER]


@pytest.fixture(params=["sqlite", "postgresql"])
def address(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """Return an address for a new history: a file, or a separate schema on the server."""
    if request.param == "sqlite":
        yield str(tmp_path / "history.sqlite")
        return
    url = sa.make_url(server())
    engine = sa.create_engine(url.set(drivername="postgresql+psycopg"))
    schema = f"history_{uuid.uuid4().hex}"
    with engine.begin() as connection:
        connection.exec_driver_sql(f"CREATE SCHEMA {schema}")
    try:
        own = url.update_query_dict({"options": f"-csearch_path={schema}"})
        yield own.render_as_string(hide_password=False)
    finally:
        with engine.begin() as connection:
            connection.exec_driver_sql(f"DROP SCHEMA {schema} CASCADE")
        engine.dispose()


@pytest.fixture
def history(address: str, new_history: bytes) -> Iterator[History]:
    """Return a new history."""
    if "://" not in address:
        Path(address).write_bytes(new_history)
    with History.open(address, create=True) as opened:
        yield opened
