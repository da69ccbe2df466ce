"""The server's own folder: the queue, uploads that wait, reports. No name in it comes from a client."""

import fcntl
import hashlib
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from emaphm.errors import ServerError
from emaphm.output_files import make_folder

if TYPE_CHECKING:
    from emaphm.history.kept_diagnosis import KeptDiagnosis

PARTIAL = ".part"
"""Ending of an upload that is being received."""


@dataclass(frozen=True)
class ServerFolder:
    """A folder that one server works in."""

    path: Path

    @property
    def queue(self) -> Path:
        """The file of the queue."""
        return self.path / "queue.sqlite"

    @property
    def uploads(self) -> Path:
        """The folder of recordings that wait."""
        return self.path / "uploads"

    def upload(self, name: str) -> Path:
        """Return the path of an upload of the name that `new_upload` gave."""
        return self.uploads / name

    def report(self, diagnosis: "KeptDiagnosis") -> Path:
        """Return the path of a diagnosis's report."""
        return self.path / "reports" / f"{content_key(diagnosis)}.html"

    def figure(self, diagnosis: "KeptDiagnosis", name: str) -> Path:
        """Return the path of a figure of a diagnosis that was drawn with its report."""
        return self.path / "reports" / f"{content_key(diagnosis)}-{name}.svg"

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other servers out while the body runs; make what is missing, remove half-received uploads.

        Raises
        ------
        ServerError
            Another server works there.
        OutputError
            The folder cannot be made.
        """
        for folder in (self.path, self.uploads, self.path / "reports"):
            make_folder(folder)
        self.path.chmod(0o700)
        with (self.path / "lock").open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise ServerError(
                    f"{self.path}: another server works in this folder; end it, or give another --work"
                ) from None
            for partial in self.uploads.glob(f"*{PARTIAL}"):
                partial.unlink(missing_ok=True)
            yield


def content_key(diagnosis: "KeptDiagnosis") -> str:
    """Return the SHA-256 of a diagnosis: of its recording, the actuator's description and the result.

    Its number in the history would not do: a history that is begun anew, or restored, gives it again.
    """
    parts = (diagnosis.recording_hash, diagnosis.settings.description, diagnosis.text)
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def new_upload(ending: str) -> str:
    """Return a name for an upload whose kind of file `ending` says; nobody else has it."""
    return f"{secrets.token_hex(16)}{ending}"


def on_disk(path: Path) -> None:
    """Return once the entries of the folder at `path` are on disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
