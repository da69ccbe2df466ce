"""A connection that sends no request is closed: silent ones would keep all others out."""

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

HEAD_SECONDS = 10.0
"""For the head of a connection's first request [s]."""


class ImpatientProtocol(H11Protocol):
    """HTTP/1.1 whose first request's head must have come within `HEAD_SECONDS`.

    Afterwards uvicorn's own limit for what is kept alive holds.
    """

    _silent: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        """Begin to wait for the head of a request."""
        super().connection_made(transport)
        self._silent = self.loop.call_later(HEAD_SECONDS, self._close_if_silent)

    def connection_lost(self, exc: Exception | None) -> None:
        """End the waiting."""
        if self._silent is not None:
            self._silent.cancel()
        super().connection_lost(exc)

    def _close_if_silent(self) -> None:
        if self.cycle is None:
            self.transport.close()
