"""The server's folder with the queue, waiting uploads and reports; no file name in it comes from a client."""

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
    """The folder of one server."""

    path: Path

    @property
    def queue(self) -> Path:
        """The file of the queue."""
        return self.path / "queue.sqlite"

    @property
    def uploads(self) -> Path:
        """The folder of waiting recordings."""
        return self.path / "uploads"

    def upload(self, name: str) -> Path:
        """Return the path of an upload with a name from `new_upload`."""
        return self.uploads / name

    def report(self, diagnosis: "KeptDiagnosis") -> Path:
        """Return the path of a diagnosis's report."""
        return self.path / "reports" / f"{content_key(diagnosis)}.html"

    def figure(self, diagnosis: "KeptDiagnosis", name: str) -> Path:
        """Return the path of a figure of a diagnosis that was drawn with its report."""
        return self.path / "reports" / f"{content_key(diagnosis)}-{name}.svg"

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Lock the folder for this server; missing folders are created and partial uploads removed.

        Raises
        ------
        ServerError
            Another server uses the folder.
        OutputError
            The folder cannot be created.
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

    The number in the history is not unique: a new or restored history assigns it again.
    """
    parts = (diagnosis.recording_hash, diagnosis.settings.description, diagnosis.text)
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def new_upload(ending: str) -> str:
    """Return a unique, random file name for an upload with this `ending`."""
    return f"{secrets.token_hex(16)}{ending}"


def on_disk(path: Path) -> None:
    """Write the entries of the folder at `path` to disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
