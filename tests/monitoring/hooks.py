"""A local receiver of webhooks whose answers a test can set."""

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any


@dataclass
class Received:
    """Received events, and the status of the answers; `status` may wait before it returns."""

    url: str = ""
    status: Callable[[], int] = lambda: 200
    events: list[dict[str, Any]] = field(default_factory=list)
    attempts: int = 0
    headers: list[str] = field(default_factory=list)


@contextmanager
def webhook() -> Iterator[Received]:
    """Yield a receiver on the loopback interface."""
    received = Received()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            received.attempts += 1
            status = received.status()
            if status == 200:
                received.events.append(json.loads(body))
                received.headers.append(self.headers["Idempotency-Key"])
            self.send_response(status)
            self.end_headers()

        def log_message(self, *_: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    received.url = f"http://127.0.0.1:{server.server_address[1]}/events"
    try:
        yield received
    finally:
        server.shutdown()
        server.server_close()
