"""Middleware that checks every request: token, origin, size and duration."""

import asyncio
import ipaddress
from http.cookies import CookieError, SimpleCookie
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse

from emaphm.server.access.tokens import Doorkeeper
from emaphm.server.settings import ServerSettings

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

COOKIE = "emaphm_session"

POLICY = "default-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'; object-src 'none'"

HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-cache, private",
}
"""Headers of every answer that does not set them itself."""

OPEN = ("/login", "/static/")
"""Paths without a token: the log-in page and its style."""

UPLOADS = ("/upload", "/api/v1/recordings")

READING = ("GET", "OPTIONS")


class Guard:
    """Middleware that passes a request on to the application, or refuses it."""

    def __init__(
        self,
        app: "ASGIApp",
        *,
        settings: ServerSettings,
        doorkeeper: Doorkeeper | None,
        only_loopback: bool,
    ) -> None:
        self._app = app
        self._settings = settings
        self._doorkeeper = doorkeeper
        self._only_loopback = only_loopback
        self._uploading = 0

    async def __call__(self, scope: "Scope", receive: "Receive", send: "Send") -> None:
        """Answer a request, as an ASGI application."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        if scope["method"] == "HEAD":
            scope, send = {**scope, "method": "GET"}, _without_body(send)
        headers = {
            name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]
        }
        refusal = self._refusal(scope, headers)
        if refusal is not None:
            await refusal(scope, receive, _with_headers(send))
            return
        if scope["method"] == "POST" and scope["path"] in UPLOADS:
            await self._upload(scope, receive, send)
            return
        body = _LimitedBody(receive, self._settings.other_bytes, self._settings.other_seconds)
        await self._run(scope, body, _with_headers(send))

    async def _upload(self, scope: "Scope", receive: "Receive", send: "Send") -> None:
        """Pass an upload on, with its limit of time and of uploads at once."""
        if self._uploading >= self._settings.uploads_at_once:
            busy = _text_answer(
                scope, 503, "too many uploads at once; try again in some seconds", {"retry-after": "5"}
            )
            await busy(scope, receive, _with_headers(send))
            return
        self._uploading += 1
        # The form's fields and boundaries add to the size of the file.
        most = self._settings.upload_bytes + self._settings.other_bytes
        body = _LimitedBody(receive, most, self._settings.upload_seconds)
        try:
            await self._run(scope, body, _with_headers(send))
        finally:
            self._uploading -= 1

    async def _run(self, scope: "Scope", body: "_LimitedBody", send: "Send") -> None:
        if body.declared_too_large(scope):
            await body.refusal(scope)(scope, body, send)
            return
        await self._app(scope, body, send)

    def _refusal(self, scope: "Scope", headers: dict[str, str]) -> "ASGIApp | None":
        """Return the answer to a request that is refused, None for a request that is passed on."""
        if self._only_loopback and not _is_loopback(headers.get("host", "")):
            # Against DNS rebinding: another site's host name may resolve to this machine.
            return _text_answer(scope, 421, "this server answers to localhost only")
        if scope["method"] not in READING and _is_foreign(headers):
            return _text_answer(scope, 403, "this form was sent by another site")
        if scope["path"].startswith(OPEN) or self._is_authorised(headers):
            return None
        if _wants_json(scope):
            return _text_answer(
                scope, 401, "give a token: Authorization: Bearer TOKEN", {"www-authenticate": "Bearer"}
            )
        return RedirectResponse("/login", status_code=303)

    def _is_authorised(self, headers: dict[str, str]) -> bool:
        if self._doorkeeper is None:
            return True
        kind, _, token = headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer" and self._doorkeeper.accepts(token.strip()):
            return True
        return self._doorkeeper.knows(session_in(headers.get("cookie", "")))


class _LimitedBody:
    """The body of a request, with limits of its size [bytes] and of the time until its last byte [s]."""

    def __init__(self, receive: "Receive", most: int, seconds: float) -> None:
        self._receive = receive
        self._most = most
        self._seconds = seconds
        self._deadline: float | None = asyncio.get_running_loop().time() + seconds
        self._received = 0

    @property
    def reason(self) -> str:
        return f"more than {self._most // 2**20} MiB; cut one manoeuvre out of the recording"

    async def __call__(self) -> "Message":
        try:
            async with asyncio.timeout_at(self._deadline):
                message = await self._receive()
        except TimeoutError:
            raise HTTPException(
                408, f"took longer than {self._seconds:g} s to send; send less of it", {"connection": "close"}
            ) from None
        if message["type"] == "http.request":
            self._received += len(message.get("body", b""))
            if self._received > self._most:
                raise HTTPException(413, self.reason, {"connection": "close"})
            if not message.get("more_body", False):
                self._deadline = None
        return message

    def declared_too_large(self, scope: "Scope") -> bool:
        declared = dict(scope["headers"]).get(b"content-length", b"0")
        return not declared.isdigit() or int(declared[:20]) > self._most

    def refusal(self, scope: "Scope") -> "ASGIApp":
        return _text_answer(
            scope,
            413,
            self.reason,
            {"connection": "close"},
        )


def session_in(cookies: str) -> str:
    """Return the key of the session in a Cookie header, empty if there is none."""
    try:
        morsel = SimpleCookie(cookies).get(COOKIE)
    except CookieError:
        return ""
    return morsel.value if morsel else ""


def _with_headers(send: "Send") -> "Send":
    async def sending(message: "Message") -> None:
        if message["type"] == "http.response.start":
            given = {name.lower() for name, _ in message.get("headers", ())}
            added = [
                (name.encode(), value.encode())
                for name, value in HEADERS.items()
                if name.encode() not in given
            ]
            message = {**message, "headers": [*message.get("headers", ()), *added]}
        await send(message)

    return sending


def _without_body(send: "Send") -> "Send":
    async def sending(message: "Message") -> None:
        await send({**message, "body": b""} if message["type"] == "http.response.body" else message)

    return sending


def _text_answer(scope: "Scope", status: int, text: str, headers: dict[str, str] | None = None) -> "ASGIApp":
    if _wants_json(scope):
        return JSONResponse({"detail": text}, status, headers)
    return PlainTextResponse(f"{text}\n", status, headers)


def _wants_json(scope: "Scope") -> bool:
    return str(scope["path"]).startswith(("/api/", "/openapi.json"))


def _is_loopback(host: str) -> bool:
    try:
        name = urlsplit(f"//{host}").hostname or ""
        return name == "localhost" or ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


def _is_foreign(headers: dict[str, str]) -> bool:
    """Return whether a page of another site sent a request, according to the browser's headers."""
    if headers.get("sec-fetch-site", "same-origin") not in {"same-origin", "none"}:
        return True
    origin = headers.get("origin")
    try:
        return origin is not None and urlsplit(origin).netloc != headers.get("host", "")
    except ValueError:  # no address at all
        return True
