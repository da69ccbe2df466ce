"""Receivers of events: standard output and a webhook."""

import errno
import hashlib
import http.client
import json
import os
import urllib.error
import urllib.request
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from emaphm.errors import MonitoringError
from emaphm.history import Event
from emaphm.monitoring.delivery import FailedError, GoneError, RefusedError
from emaphm.version import VERSION

MAY_PASS = (408, 425, 429)
"""Status codes 4xx that do not refuse the event: timeout, too early, too many requests."""

LINES = "lines"
"""Identifier of standard output in the history."""


@dataclass(eq=False)
class Lines:
    """Events as lines of JSON on a file descriptor; `is_closed` when its reader has closed it."""

    descriptor: int
    key: str = LINES
    shown: str = "standard output"
    is_closed: bool = False
    _event: str = ""
    _rest: bytes = b""

    def send(self, event: Event) -> None:
        """Write an event; a line that a full disk has cut is completed at the next attempt."""
        if self._event != event.key:
            self._event = event.key
            self._rest = (json.dumps(event.to_dict(), allow_nan=False) + "\n").encode()
        try:
            while self._rest:
                self._rest = self._rest[os.write(self.descriptor, self._rest) :]
        except OSError as error:
            self.is_closed = error.errno in {errno.EPIPE, errno.EBADF}
            if self.is_closed:
                raise GoneError from None
            raise FailedError(error.strerror or str(error)) from None
        self._event = ""


class _NoRedirects(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_: Any) -> None:
        """Follow no redirect: events are sent to the given address only."""


@dataclass(frozen=True, eq=False)
class Webhook:
    """An address to which each event is sent by POST, as JSON; the `Idempotency-Key` is the event's id."""

    url: str
    timeout_s: float

    def __post_init__(self) -> None:
        try:
            parts = urlsplit(self.url)
            is_usable = parts.scheme in {"http", "https"} and bool(parts.hostname) and (parts.port or 1) > 0
            is_usable = is_usable and parts.username is None and self.url.isascii()
        except ValueError:
            is_usable = False
        if not is_usable or not self.url.isprintable() or " " in self.url:
            raise MonitoringError(
                "--webhook: give an address such as https://host/path, in ASCII, without user and password"
            )

    @property
    def key(self) -> str:
        """The SHA-256 of the address, which may contain a secret."""
        return f"webhook {hashlib.sha256(self.url.encode()).hexdigest()}"

    @property
    def shown(self) -> str:
        """The address without the parts that may be secret."""
        parts = urlsplit(self.url)
        return f"webhook {parts.scheme}://{parts.hostname}{f':{parts.port}' if parts.port else ''}"

    def send(self, event: Event) -> None:
        """Send an event."""
        request = urllib.request.Request(  # noqa: S310 - http and https only, see above
            self.url,
            json.dumps(event.to_dict(), allow_nan=False).encode(),
            {
                "Content-Type": "application/json",
                "Idempotency-Key": event.key,
                "User-Agent": f"emaphm/{VERSION}",
            },
        )
        try:
            with urllib.request.build_opener(_NoRedirects).open(request, timeout=self.timeout_s):
                return
        except urllib.error.HTTPError as error:
            error.close()
            if 300 <= error.code < 500 and error.code not in MAY_PASS:
                raise RefusedError(f"status {error.code}") from None
            raise FailedError(f"status {error.code}") from None
        except (OSError, http.client.HTTPException, ValueError) as error:
            # The texts of other errors are not quoted, because they may contain the address.
            known = getattr(error, "reason", None) or (error if isinstance(error, OSError) else None)
            raise FailedError(f"does not answer ({known or type(error).__name__})") from None
