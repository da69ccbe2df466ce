"""Connections: a silent or slow one is closed, one that has asked is kept."""

import asyncio
import socket
import threading
from collections.abc import Iterator
from typing import Any

import pytest

uvicorn = pytest.importorskip("uvicorn")

HEAD_S = 0.2


ANSWER_S = 2 * HEAD_S


async def app(scope: Any, _: Any, send: Any) -> None:
    """Answer everything with nothing, and what is called slow slowly."""
    if scope["path"] == "/slow":
        await asyncio.sleep(ANSWER_S)
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"0")]})
    await send({"type": "http.response.body", "body": b""})


@pytest.fixture
def address(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[str, int]]:
    from emaphm.server.access import connection

    monkeypatch.setattr(connection, "HEAD_SECONDS", HEAD_S)
    listening = socket.create_server(("127.0.0.1", 0))
    config = uvicorn.Config(app, http=connection.ImpatientProtocol, lifespan="off", log_level="error")
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
    thread.start()
    yield listening.getsockname()
    server.should_exit = True
    thread.join(30)


@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\nHost: a\r\n"], ids=["nothing", "half a head"])
def test_one_that_asks_nothing_is_closed(address: tuple[str, int], sent: bytes) -> None:
    with socket.create_connection(address, timeout=30) as silent:
        silent.sendall(sent)
        assert silent.recv(1) == b""


def asked(connection: socket.socket, method: str = "GET", fields: str = "", path: str = "/") -> None:
    """Send a request, and take the answer."""
    connection.sendall(f"{method} {path} HTTP/1.1\r\nHost: a\r\n{fields}\r\n".encode())
    assert connection.recv(12) == b"HTTP/1.1 200"
    while b"\r\n\r\n" not in connection.recv(4096):
        pass


def test_one_that_has_asked_is_kept_however_long_the_answer_takes(address: tuple[str, int]) -> None:
    with socket.create_connection(address, timeout=30) as asking:
        for _ in range(2):
            asked(asking, path="/slow")


@pytest.mark.parametrize(
    ("method", "fields", "sent"),
    [("GET", "", b"GET / HTTP/1.1\r\nHost: a"), ("POST", "Content-Length: 100\r\n", b"x")],
    ids=["half a head", "a body that was not read"],
)
def test_one_that_goes_on_with_a_part_is_closed(
    address: tuple[str, int], method: str, fields: str, sent: bytes
) -> None:
    with socket.create_connection(address, timeout=30) as slow:
        asked(slow, method, fields)
        slow.sendall(sent)
        assert slow.recv(1) == b""
