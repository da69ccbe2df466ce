"""A server on a network socket, in a thread of this process."""

import socket
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import uvicorn

from emaphm.actuator import Actuator
from emaphm.server.app import create_app
from emaphm.server.run import running
from emaphm.server.settings import SETTINGS, ServerSettings


@contextmanager
def served(
    file: Path, tokens: Mapping[str, str] | None = None, settings: ServerSettings = SETTINGS
) -> Iterator[str]:
    """Yield the address of a server of the history in `file`."""
    with (
        running(str(file), tokens, None, {"thesis": Actuator.thesis()}, settings) as state,
        socket.create_server(("127.0.0.1", 0)) as listening,
    ):
        config = uvicorn.Config(create_app(state), log_level="warning", lifespan="off")
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        try:
            yield f"http://127.0.0.1:{listening.getsockname()[1]}"
        finally:
            server.should_exit = True
            thread.join()
