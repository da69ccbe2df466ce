"""What is watched, and how."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from emaphm.errors import MonitoringError
from emaphm.history.writing import storable
from emaphm.monitoring.diagnosers import Diagnose, search
from emaphm.monitoring.judging import Cut, cut_stretches
from emaphm.monitoring.ownership import Ownership
from emaphm.monitoring.receivers import Webhook
from emaphm.monitoring.settings import WATCH

if TYPE_CHECKING:
    from emaphm.detection import Detector

STDIN = "stdin"


@dataclass(frozen=True, eq=False)
class WatchTask:
    """What is watched, and how.

    Attributes
    ----------
    source
        A folder, or the file descriptor of a stream.
    ownership
        How the unit and the hours of a recording are known.
    name
        Of the watcher: what it has done stands in the history under this name; the folder's path, or "stdin",
        where left out.
    split
        What a file is cut by into recordings, as in `emaphm.read_recordings`.
    cut
        Returns the stretches of a recording that identify something; None where it is judged as a whole.
    diagnose
        What diagnoses them, as `emaphm.diagnose` does, which is the usual; or an estimator.
    detector
        Says in addition whether they are like healthy ones.
    takes_new_units
        Whether units that the history does not know are added to it.
    isolated
        Whether recordings are read and diagnosed in a process of their own, and prognoses made in another.
        A recording that kills its process, or takes too long, is tried once more and then set aside. Without
        it, `stop` waits for what is under way. A script needs the usual ``if __name__ == "__main__":``.
    once
        Whether to end when all that is there is judged.
    webhook, lines
        Where events go: an address; a file descriptor.
    """

    source: Path | int
    ownership: Ownership
    name: str = ""
    split: str | None = None
    cut: Cut | None = cut_stretches
    diagnose: Diagnose = search
    detector: "Detector | None" = None
    takes_new_units: bool = False
    isolated: bool = False
    once: bool = False
    seed: int = 0
    webhook: str | None = None
    lines: int | None = None

    @property
    def watcher(self) -> str:
        """The name of the watcher."""
        return storable(self.name or (STDIN if isinstance(self.source, int) else str(self.source.absolute())))

    def check(self) -> None:
        """Refuse a folder or an address that cannot be used, `MonitoringError`."""
        if isinstance(self.source, Path) and not self.source.is_dir():
            what = "is no folder" if self.source.exists() else "no such folder"
            raise MonitoringError(f"{self.source}: {what}; give one where recordings arrive, or - for stdin")
        if isinstance(self.source, Path) and not os.access(self.source, os.R_OK | os.X_OK):
            raise MonitoringError(f"{self.source}: cannot be read; let this user read the folder")
        if self.webhook is not None:
            Webhook(self.webhook, WATCH.delivery.timeout_s)
