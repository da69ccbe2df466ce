"""State that requests share: the history, the fleet in memory, the queue and the processes."""

from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from secrets import token_hex

from emaphm.history import History
from emaphm.memory import Memory
from emaphm.server.access.tokens import Doorkeeper
from emaphm.server.fleet import FleetView
from emaphm.server.folders import ServerFolder
from emaphm.server.settings import ServerSettings
from emaphm.server.uploads import Uploads
from emaphm.server.work.drawing import Drawer
from emaphm.server.work.pool import Pool
from emaphm.server.work.queue import Queue


@dataclass
class Kept:
    """Cache of rendered pages, each of one version of the fleet; `made_by` identifies this server process."""

    pages: Memory[bytes]
    made_by: str = field(default_factory=lambda: token_hex(8))

    def tag(self, key: tuple[object, ...]) -> str:
        """Return the entity tag of the page of `key`, so that a browser need not load the page again."""
        text = f"{self.made_by} {key!r}".encode()
        return f'W/"{sha256(text).hexdigest()[:32]}"'


@dataclass(frozen=True)
class ServerState:
    """State that requests share; `templates` is the folder of a user's templates, None without any."""

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
