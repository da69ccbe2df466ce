"""Definition of a monitoring task: its source, diagnosis and receivers."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from emaphm.errors import MonitoringError
from emaphm.history.writing import storable
from emaphm.input_files import exists
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
    """Definition of a monitoring task.

    Attributes
    ----------
    source
        A folder, or the file descriptor of a stream.
    ownership
        Rules for the unit and the hours of a recording.
    name
        Name of the watcher, which identifies its progress in the history; if omitted, the folder's path, or
        "stdin".
    split
        Way to cut a file into recordings, as in `emaphm.read_recordings`.
    cut
        Returns the stretches of a recording that identify faults; None if a recording is judged as a whole.
    diagnose
        Method of diagnosis: by default `emaphm.diagnose`, or an estimator.
    detector
        Detector that compares recordings with healthy recordings, in addition to the diagnosis.
    takes_new_units
        Whether new units are added to the history.
    isolated
        Whether recordings are read and diagnosed in a separate process, and prognoses computed in another. A
        recording that kills its process, or takes too long, is tried once more and then set aside. Without
        isolation, `stop` waits for the running diagnosis. A script needs the usual ``if __name__ ==
        "__main__":``.
    once
        Whether to end when all present recordings are judged.
    seed
        Source of all randomness.
    webhook, lines
        Receivers of events: an address, a file descriptor.
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
        """Raise `MonitoringError` for a folder or an address that cannot be used."""
        if isinstance(self.source, Path):
            _check_folder(self.source)
        if self.webhook is not None:
            Webhook(self.webhook, WATCH.delivery.timeout_s)


def _check_folder(folder: Path) -> None:
    reason = "is no folder" if exists(folder, MonitoringError) else "no such folder"
    if not folder.is_dir():
        raise MonitoringError(f"{folder}: {reason}; give one where recordings arrive, or - for stdin")
    if not os.access(folder, os.R_OK | os.X_OK):
        raise MonitoringError(f"{folder}: cannot be read; let this user read the folder")
