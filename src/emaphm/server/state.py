"""What requests share: the history, the fleet in memory, the queue, the processes."""

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from secrets import token_hex

from emaphm.history import History
from emaphm.server.fleet import FleetView
from emaphm.server.folders import ServerFolder
from emaphm.server.settings import ServerSettings
from emaphm.server.tokens import Doorkeeper
from emaphm.server.uploads import Uploads
from emaphm.server.work.drawing import Drawer
from emaphm.server.work.pool import Pool
from emaphm.server.work.queue import Queue


@dataclass
class Kept:
    """Rendered pages, the newest, each of one version of the fleet; `made_by` names this server."""

    most: int
    made_by: str = field(default_factory=lambda: token_hex(8))
    pages: OrderedDict[tuple[object, ...], bytes] = field(default_factory=OrderedDict)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def tag(self, key: tuple[object, ...]) -> str:
        """Return the entity tag of the page of `key`: a browser that has it is not sent it again."""
        text = f"{self.made_by} {key!r}".encode()
        return f'W/"{sha256(text).hexdigest()[:32]}"'

    def page(self, key: tuple[object, ...], render: Callable[[], bytes]) -> bytes:
        """Return the page of `key`, rendered where it is not there."""
        with self.lock:
            if key in self.pages:
                return self.pages[key]
        content = render()
        with self.lock:
            self.pages[key] = content
            while len(self.pages) > self.most:
                self.pages.popitem(last=False)
        return content


@dataclass(frozen=True)
class ServerState:
    """All of it; `templates` is a user's folder of them."""

    history: History
    folder: ServerFolder
    queue: Queue
    pool: Pool
    drawer: Drawer
    fleet: FleetView
    uploads: Uploads
    doorkeeper: Doorkeeper | None
    settings: ServerSettings
    kept: Kept
    templates: Path | None = None
