"""Folder of a long computation: its results, its settings, and a lock."""

import fcntl
import json
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from emaphm.errors import EmaphmError
from emaphm.input_files import exists, is_folder
from emaphm.output_files import written_whole

RESULTS = "results.sqlite"
LOCK = ".lock"

TEMPORARY = re.compile(r"\.[0-9a-f]{32}\.tmp")
"""Names of temporary files that remain if `written_whole` is killed."""

NOTHING = "nothing"
MOST_NAMED = 3
"""Largest number of differences between two settings that a message names."""


@dataclass(frozen=True)
class WorkFolder:
    """Folder in which one process at a time works.

    `file` is the name of the file of settings, `kind` the name of the computation in messages, `error` the
    class of raised errors.
    """

    path: Path
    file: str
    kind: str
    error: type[EmaphmError]

    @property
    def settings(self) -> Path:
        """Path of the file of settings."""
        return self.path / self.file

    @property
    def results(self) -> Path:
        """Path of the file of results."""
        return self.path / RESULTS

    def begin(self, settings: str) -> None:
        """Make the folder with its file of settings, unless another process has made it meanwhile.

        Raises
        ------
        EmaphmError
            The folder contains other files, or cannot be made or written.
        """
        folder = self.path
        if exists(folder, self.error) and not is_folder(folder, self.error):
            raise self.error(f"{folder} is not a folder; give another name")
        if is_folder(folder, self.error) and self._holds_files():
            raise self.error(f"{folder} holds something else than a {self.kind}; give a new or empty folder")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self.error(f"{folder} cannot be created ({error.strerror}); give another place") from None
        with self.locked():
            if not self.settings.exists():
                with written_whole(self.settings) as temporary:
                    temporary.write_text(settings, encoding="utf-8")

    def begin_or_resume(self, settings: str, *, elsewhere: str = "another folder with -o") -> str:
        """Begin with `settings` (JSON), or resume; return the differences from the folder's settings.

        The result is empty without differences, and for a new folder. `elsewhere` is the alternative to this
        folder that messages propose. `settings` contain the `revision` of the code (`revision_of`).

        Raises
        ------
        EmaphmError
            As in `begin`; or the folder's settings cannot be read, or have another revision or none.
        """
        if not exists(self.settings, self.error):
            self.begin(settings)
        try:
            stored = json.loads(self.settings.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            reason = str(error).splitlines()[0]
            raise self.error(f"{self.settings}: cannot be read ({reason}); give {elsewhere}") from None
        given = json.loads(settings)
        made_by = stored.get("revision") if isinstance(stored, dict) else None
        if made_by != given["revision"]:
            raise self.error(
                f"{self.path} holds a {self.kind} made by another version of emaphm "
                f"({made_by or 'an earlier one'}; this is {given['revision']}); "
                f"give {elsewhere}, or remove this one"
            )
        return difference(stored, given)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Lock the folder for other processes while the body runs; the lock ends with the process."""
        try:
            lock = (self.path / LOCK).open("w")
        except FileNotFoundError:
            raise self._removed() from None
        except OSError as error:
            raise self._not_writable(error) from None
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise self.error(
                    f"another {self.kind} is running in {self.path}; wait, or give another folder"
                ) from None
            except OSError as error:
                raise self._not_writable(error) from None
            if not self._is_current(lock.fileno()):
                raise self._removed()
            yield

    def _holds_files(self) -> bool:
        """Return whether the folder has files or folders that are not hidden."""
        try:
            return any(not path.name.startswith(".") for path in self.path.iterdir())
        except OSError as error:
            raise self._not_writable(error) from None

    def _is_current(self, lock: int) -> bool:
        """Return whether an open lock file is still the lock file of the folder."""
        try:
            return os.path.samestat(os.fstat(lock), (self.path / LOCK).stat())
        except OSError:
            return False

    def remove(self) -> None:
        """Remove the folder with its contents, unless another process is working in it."""
        renamed = self.path.with_name(f".{os.urandom(16).hex()}.tmp")
        try:
            with self.locked():
                # Renamed first, so that another process can begin a new folder at once.
                self.path.rename(renamed)
        except (OSError, EmaphmError):
            return
        shutil.rmtree(renamed, ignore_errors=True)

    def clear(self) -> None:
        """Remove temporary files of a killed process, also in subfolders."""
        try:
            for path in [path for path in self.path.rglob("*.tmp") if TEMPORARY.fullmatch(path.name)]:
                path.unlink()
        except OSError as error:
            raise self._not_writable(error) from None

    def _removed(self) -> EmaphmError:
        return self.error(f"{self.path} has been removed meanwhile; start again")

    def _not_writable(self, error: OSError) -> EmaphmError:
        return self.error(f"{self.path} cannot be written to ({error.strerror}); give another folder with -o")


def difference(there: Any, here: Any) -> str:
    """Return the differences between the settings `there` (stored) and `here` (given) as text, or ""."""
    stored, given = dict(_leaves(there)), dict(_leaves(here))
    keys = [key for key in {**stored, **given} if stored.get(key, NOTHING) != given.get(key, NOTHING)]
    named = [f"'{key}' ({stored.get(key, NOTHING)} there, {given.get(key, NOTHING)} here)" for key in keys]
    more = f" and {len(keys) - MOST_NAMED} more" if len(keys) > MOST_NAMED else ""
    return ", ".join(named[:MOST_NAMED]) + more


def _leaves(value: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Yield dotted key and value, as text, of each value in nested tables and lists."""
    if isinstance(value, list):
        value = {str(place): item for place, item in enumerate(value)}
    if not isinstance(value, dict) or not value:
        yield key, repr(value)
        return
    for name, item in value.items():
        yield from _leaves(item, f"{key}.{name}" if key else name)
