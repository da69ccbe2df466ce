"""Connections are closed if the client is silent or slow, and kept after a request."""

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
    """Answer each request with an empty body, and the path /slow after a delay."""
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
def test_a_connection_without_a_complete_request_is_closed(address: tuple[str, int], sent: bytes) -> None:
    with socket.create_connection(address, timeout=30) as silent:
        silent.sendall(sent)
        assert silent.recv(1) == b""


def request(connection: socket.socket, method: str = "GET", fields: str = "", path: str = "/") -> None:
    """Send a request, and read the answer."""
    connection.sendall(f"{method} {path} HTTP/1.1\r\nHost: a\r\n{fields}\r\n".encode())
    assert connection.recv(12) == b"HTTP/1.1 200"
    while b"\r\n\r\n" not in connection.recv(4096):
        pass


def test_a_connection_is_kept_during_and_after_a_slow_answer(address: tuple[str, int]) -> None:
    with socket.create_connection(address, timeout=30) as asking:
        for _ in range(2):
            request(asking, path="/slow")


@pytest.mark.parametrize(
    ("method", "fields", "sent"),
    [("GET", "", b"GET / HTTP/1.1\r\nHost: a"), ("POST", "Content-Length: 100\r\n", b"x")],
    ids=["half a head", "a body that was not read"],
)
def test_a_kept_connection_with_an_incomplete_request_is_closed(
    address: tuple[str, int], method: str, fields: str, sent: bytes
) -> None:
    with socket.create_connection(address, timeout=30) as slow:
        request(slow, method, fields)
        slow.sendall(sent)
        assert slow.recv(1) == b""
