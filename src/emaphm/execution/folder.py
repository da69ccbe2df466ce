"""The folder of long work: its results, the settings that they were made with, and a lock."""

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
from emaphm.output_files import written_whole

RESULTS = "results.sqlite"
LOCK = ".lock"

TEMPORARY = re.compile(r"\.[0-9a-f]{32}\.tmp")
"""Files that `written_whole` leaves in a folder when it is killed."""

NOTHING = "nothing"
MOST_NAMED = 3
"""Differences between two settings that are named one by one."""


@dataclass(frozen=True)
class WorkFolder:
    """A folder that one process at a time works in.

    `file` is the name of its settings, `kind` what messages call the work, `error` what is raised.
    """

    path: Path
    file: str
    kind: str
    error: type[EmaphmError]

    @property
    def settings(self) -> Path:
        """The file of settings."""
        return self.path / self.file

    @property
    def results(self) -> Path:
        """The file of results."""
        return self.path / RESULTS

    def begin(self, settings: str) -> None:
        """Make the folder with its file of settings, unless another process has done so meanwhile.

        Raises
        ------
        EmaphmError
            The folder holds something else, or cannot be made or written.
        """
        folder = self.path
        if folder.exists() and not folder.is_dir():
            raise self.error(f"{folder} is not a folder; give another name")
        if folder.is_dir() and any(not path.name.startswith(".") for path in folder.iterdir()):
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
        """Begin with `settings` (JSON) or resume; return how they differ from those it was begun with.

        The result is empty where nothing differs, and for a new folder. `elsewhere` is what messages propose
        in place of this folder. `settings` name the `revision` of the code (`revision_of`).

        Raises
        ------
        EmaphmError
            As `begin`, or the folder's settings cannot be read or are of another revision or of none.
        """
        if not self.settings.exists():
            self.begin(settings)
        try:
            there = json.loads(self.settings.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            reason = str(error).splitlines()[0]
            raise self.error(f"{self.settings}: cannot be read ({reason}); give {elsewhere}") from None
        here = json.loads(settings)
        made_by = there.get("revision") if isinstance(there, dict) else None
        if made_by != here["revision"]:
            raise self.error(
                f"{self.path} holds a {self.kind} made by another version of emaphm "
                f"({made_by or 'an earlier one'}; this is {here['revision']}); "
                f"give {elsewhere}, or remove this one"
            )
        return difference(there, here)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep every other process out of the folder while the body runs, however this one ends."""
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
            if not self._holds(lock.fileno()):
                raise self._removed()
            yield

    def _holds(self, lock: int) -> bool:
        try:
            return os.path.samestat(os.fstat(lock), (self.path / LOCK).stat())
        except OSError:
            return False

    def remove(self) -> None:
        """Remove the folder with all that it holds, unless another process is working in it."""
        away = self.path.with_name(f".{os.urandom(16).hex()}.tmp")
        try:
            with self.locked():
                # As a whole: whoever comes meanwhile begins another one.
                self.path.rename(away)
        except (OSError, EmaphmError):
            return
        shutil.rmtree(away, ignore_errors=True)

    def clear(self) -> None:
        """Remove what a killed process left half-written, in its folders too."""
        try:
            for path in [one for one in self.path.rglob("*.tmp") if TEMPORARY.fullmatch(one.name)]:
                path.unlink()
        except OSError as error:
            raise self._not_writable(error) from None

    def _removed(self) -> EmaphmError:
        return self.error(f"{self.path} has been removed meanwhile; start again")

    def _not_writable(self, error: OSError) -> EmaphmError:
        return self.error(f"{self.path} cannot be written to ({error.strerror}); give another folder with -o")


def difference(there: Any, here: Any) -> str:
    """Return which keys differ between a folder's settings and the given ones, and how; empty if none."""
    kept, given = dict(_leaves(there)), dict(_leaves(here))
    keys = [key for key in {**kept, **given} if kept.get(key, NOTHING) != given.get(key, NOTHING)]
    named = [f"'{key}' ({kept.get(key, NOTHING)} there, {given.get(key, NOTHING)} here)" for key in keys]
    more = f" and {len(keys) - MOST_NAMED} more" if len(keys) > MOST_NAMED else ""
    return ", ".join(named[:MOST_NAMED]) + more


def _leaves(value: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Yield the values in nested tables and lists as text, by their dotted keys."""
    if isinstance(value, list):
        value = {str(place): item for place, item in enumerate(value)}
    if not isinstance(value, dict) or not value:
        yield key, repr(value)
        return
    for name, item in value.items():
        yield from _leaves(item, f"{key}.{name}" if key else name)
