"""Access control by tokens, and requests that are refused before they use resources."""

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from emaphm.errors import ServerError
from emaphm.server.access.guard import Guard
from emaphm.server.access.tokens import Doorkeeper, add_token, read_tokens

from .conftest import SMALL, client_of

if TYPE_CHECKING:
    from starlette.testclient import TestClient

    from emaphm.server.state import ServerState


@pytest.fixture
def token(tmp_path: Path) -> str:
    return add_token(tmp_path / "tokens", "alice")


@pytest.fixture
def closed(state: "ServerState", token: str, tmp_path: Path) -> "TestClient":
    """Return a client of a server that requires a token."""
    assert token
    doorkeeper = Doorkeeper(read_tokens(tmp_path / "tokens"), 1.0)
    return client_of(replace(state, doorkeeper=doorkeeper), only_loopback=False)


def test_only_the_hash_of_a_token_is_stored(token: str, tmp_path: Path) -> None:
    file = tmp_path / "tokens"
    assert token not in file.read_text()
    assert file.stat().st_mode & 0o777 == 0o600
    second = add_token(file, "bob")
    assert set(read_tokens(file).values()) == {"alice", "bob"}
    assert Doorkeeper(read_tokens(file), 1.0).accepts(second)
    with pytest.raises(ServerError, match="'bob' already"):
        add_token(file, "bob")


def test_a_token_file_that_other_users_can_read_is_refused(tmp_path: Path) -> None:
    add_token(tmp_path / "tokens", "alice")
    (tmp_path / "tokens").chmod(0o640)
    with pytest.raises(ServerError, match="chmod 600"):
        read_tokens(tmp_path / "tokens")


@pytest.mark.parametrize("content", ["", "alice secret\n", "\0\xff"])
def test_a_file_without_valid_tokens_is_refused(content: str, tmp_path: Path) -> None:
    file = tmp_path / "tokens"
    file.write_text(content)
    file.chmod(0o600)
    with pytest.raises(ServerError):
        read_tokens(file)


def test_requests_without_a_valid_token_are_refused(closed: "TestClient", token: str) -> None:
    assert closed.get("/").headers["location"] == "/login"
    assert closed.get("/api/v1/units").status_code == 401
    assert closed.get("/openapi.json").status_code == 401
    for wrong in ("Bearer ", "Bearer nonsense", f"Basic {token}", token):
        assert closed.get("/api/v1/units", headers={"Authorization": wrong}).status_code == 401
    assert closed.get("/api/v1/units", headers={"Authorization": f"Bearer {token}"}).status_code == 200


def test_a_browser_logs_in_and_out(closed: "TestClient", token: str) -> None:
    assert closed.post("/login", data={"token": "nonsense"}).status_code == 401
    answer = closed.post("/login", data={"token": token})
    assert {"HttpOnly", "SameSite=strict"} <= set(answer.headers["set-cookie"].split("; "))
    assert token not in answer.headers["set-cookie"]
    assert closed.get("/").status_code == 200
    session = closed.cookies["emaphm_session"]
    closed.post("/logout")
    closed.cookies.set("emaphm_session", session)
    assert closed.get("/").status_code == 303


def test_requests_from_other_sites_are_refused(client: "TestClient") -> None:
    assert client.get("/", headers={"Host": "attacker.example"}).status_code == 421
    assert client.get("/", headers={"Host": "[::1]:8000"}).status_code == 200
    for header in (
        {"Origin": "http://attacker.example"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Origin": "null"},
    ):
        assert client.post("/api/v1/recordings", headers=header).status_code == 403
    own = {"Origin": "http://127.0.0.1:8000", "Sec-Fetch-Site": "same-origin"}
    assert client.post("/api/v1/recordings", headers=own).status_code == 422


def answered_status(
    guard: Guard,
    body: list[dict[str, Any]],
    *,
    path: str = "/api/v1/recordings",
    declared: bytes | None = None,
    pause_s: float = 0.0,
) -> int:
    """Return the status of the answer to a request with `body`, by default an upload."""
    sent: list[Any] = []

    async def receive() -> Any:
        await asyncio.sleep(pause_s)
        return body.pop(0)

    async def send(message: Any) -> None:
        sent.append(message)

    headers = [(b"host", b"localhost"), (b"content-type", b"multipart/form-data; boundary=x")]
    headers += [(b"content-length", declared)] if declared is not None else []
    scope = {"type": "http", "method": "POST", "path": path, "headers": headers}
    asyncio.run(guard(scope, receive, send))
    return int(sent[0]["status"])


async def reader(scope: Any, receive: Any, send: Any) -> None:
    """Read the whole body, as an application does."""
    from starlette.exceptions import HTTPException
    from starlette.responses import PlainTextResponse

    status = 200
    try:
        while (await receive()).get("more_body"):
            pass
    except HTTPException as error:
        status = error.status_code
    await PlainTextResponse("", status)(scope, receive, send)


def chunk(size: int, *, more: bool = True) -> dict[str, Any]:
    return {"type": "http.request", "body": bytes(size), "more_body": more}


def test_too_large_too_slow_and_too_many_uploads_are_refused() -> None:
    few = replace(SMALL, upload_seconds=0.05, uploads_at_once=1, other_seconds=0.05)
    guard = Guard(reader, settings=few, doorkeeper=None, only_loopback=True)
    assert answered_status(guard, [chunk(10, more=False)]) == 200
    assert answered_status(guard, [], declared=b"2147483648") == 413
    assert answered_status(guard, [], declared=b"9" * 400) == 413
    assert answered_status(guard, [], declared=b"-1") == 413
    assert answered_status(guard, [chunk(200_000), chunk(200_000), chunk(1, more=False)]) == 413
    assert answered_status(guard, [chunk(1)] * 100, pause_s=0.01) == 408
    assert answered_status(guard, [chunk(1)] * 100, path="/login", pause_s=0.01) == 408
    guard._uploading = 1
    assert answered_status(guard, [chunk(10, more=False)]) == 503
