"""A connection that sends no request is closed: silent and slow ones would keep all others out."""

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle

HEAD_SECONDS = 10.0
"""For the head of a request, from the connection or the answer before it [s]."""


class ImpatientProtocol(H11Protocol):
    """HTTP/1.1 where the head of each request must have come within `HEAD_SECONDS`.

    uvicorn's own limit for what is kept alive ends with the first byte that comes.
    """

    _silent: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        """Begin to wait for the head of a request."""
        super().connection_made(transport)
        self._expect_head()

    def on_response_complete(self) -> None:
        """Begin to wait for the head of the next request."""
        self._expect_head()
        super().on_response_complete()

    def connection_lost(self, exc: Exception | None) -> None:
        """End the waiting."""
        if self._silent is not None:
            self._silent.cancel()
        super().connection_lost(exc)

    def _expect_head(self) -> None:
        if self._silent is not None:
            self._silent.cancel()
        self._silent = self.loop.call_later(HEAD_SECONDS, self._close_if_silent, self.cycle)

    def _close_if_silent(self, last: RequestResponseCycle | None) -> None:
        if self.cycle is last:  # no further request has come
            self.transport.close()
