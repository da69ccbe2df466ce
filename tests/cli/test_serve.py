"""`emaphm serve` with options or files that cannot be served, or not safely."""

import os
import socket
from pathlib import Path

import pytest

from .conftest import Emaphm, Refusal

pytest.importorskip("fastapi", reason="needs the extra 'server'")


@pytest.fixture
def db(tmp_path: Path) -> str:
    from emaphm.history import History

    History.open(tmp_path / "h.sqlite", create=True).close()
    return str(tmp_path / "h.sqlite")


def test_a_port_in_use_is_refused(refused: Refusal, db: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as occupied:
        port = occupied.getsockname()[1]
        message = refused("serve", "--db", db, "--port", port)
    assert f"127.0.0.1:{port} cannot be used" in message
    assert "give another --port" in message


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--port", "70000"), "from 0 to 65535"),
        (("--host", "0.0.0.0"), "--add-token NAME"),  # noqa: S104 - the address is refused
        (("--tokens", "none"), "none: no such file; make it with --tokens none --add-token NAME"),
        (("--healthy", "none.json"), "none.json"),
        (("--host", "no.such.host.invalid"), "--add-token NAME"),
        (("--workers", "0"), "1 or more"),
        (("--actuator", "absent.toml"), "no such actuator file"),
        (("--add-token", "alice"), "--tokens FILE"),
        (("--webhook", "ftp://host"), "--webhook: give an address such as https://host/path"),
        (("--horizon", "0"), "a horizon of 0 h"),
        (("--risk", "2"), "a risk of 2 is not a probability"),
    ],
)
def test_impossible_options_are_refused(
    refused: Refusal, db: str, options: tuple[str, ...], reason: str
) -> None:
    port = () if "--port" in options else ("--port", 0)
    assert reason in refused("serve", "--db", db, *port, *options)


def test_a_missing_or_foreign_database_is_refused(refused: Refusal, tmp_path: Path) -> None:
    import sqlite3

    absent, empty = tmp_path / "absent.sqlite", tmp_path / "empty.sqlite"
    empty.touch()
    for path, reason in ((absent, "no such history"), (empty, "holds no history")):
        message = refused("serve", "--db", path, "--port", 0)
        assert f"{reason}; begin one by its first recording: emaphm history add RECORDING" in message
        assert f"--unit SERIAL --hours HOURS --db {path};" in message
    with sqlite3.connect(tmp_path / "other.sqlite") as connection:
        connection.execute("CREATE TABLE music (name TEXT)")
    connection.close()
    assert "is no history" in refused("serve", "--db", tmp_path / "other.sqlite", "--port", 0)


def test_a_token_is_printed_once(emaphm: Emaphm, refused: Refusal, db: str, tmp_path: Path) -> None:
    file = tmp_path / "tokens"
    answer = emaphm("serve", "--tokens", file, "--add-token", "alice")
    assert answer.code == 0
    assert answer.out.split()[0] not in file.read_text()
    os.chmod(file, 0o644)  # noqa: PTH101 - the access rights that are refused
    assert "chmod 600" in refused("serve", "--db", db, "--port", 0, "--tokens", file)
