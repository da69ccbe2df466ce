"""A folder as a source: each complete file is passed on exactly once, even after interruptions."""

import hashlib
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from heapq import nsmallest
from itertools import islice
from pathlib import Path

from emaphm.actuator import Actuator
from emaphm.errors import RecordingError
from emaphm.history import Entry, Event
from emaphm.monitoring.arrival import Arrival, Call, call_here
from emaphm.monitoring.ownership import HOURS_LABEL, Ownership
from emaphm.monitoring.settings import FolderSettings
from emaphm.monitoring.watch_state import AGAIN, CHANGED, REFUSED, SET_ASIDE, TRIED, WatchedFile, WatchState
from emaphm.recording import Recording, read_recordings
from emaphm.recording.io.read import READERS

AT_ONCE = 500
"""Number of names in one query of the history."""


@dataclass
class CandidateFile:
    """State of a file at the last poll; `since` is the first time with this state, `time.monotonic` [s]."""

    name: str
    size: int
    modified_ns: int
    since: float
    tries: int = 0

    def same(self, status: os.stat_result) -> bool:
        """Return whether size and time of the file are unchanged."""
        return (self.size, self.modified_ns) == (status.st_size, status.st_mtime_ns)

    def same_as(self, before: "CandidateFile | WatchedFile") -> bool:
        """Return whether size and time of the file are those that it had `before`."""
        return (self.size, self.modified_ns) == (before.size, before.modified_ns)


@dataclass(eq=False)
class FolderSource:
    """The files in a folder as a source, without subfolders, hidden files and other endings.

    The folder is polled, because notifications are not available on network shares. A file is complete if it
    has not changed for `settle_s`. Judged files are noted in the history.
    """

    folder: Path
    actuator: Actuator
    ownership: Ownership
    state: WatchState
    settings: FolderSettings
    split: str | None = None
    call: Call = call_here
    is_lost: bool = False
    _candidates: dict[str, CandidateFile] = field(default_factory=dict)
    _ready: list[CandidateFile] = field(default_factory=list)
    _next_poll: float = 0.0
    _has_polled: bool = False
    _events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.state.forget_refused()

    def next(self) -> Arrival | None:
        """Return the next complete file as an arrival, after polling the folder if it is time for it."""
        if time.monotonic() >= self._next_poll:
            self._poll()
        while self._ready:
            candidate = self._ready.pop(0)
            self._candidates.pop(candidate.name, None)
            arrival = self._arrival(candidate)
            if arrival is not None:
                return arrival
        return None

    def events(self) -> list[Event]:
        """Return the events on a lost or restored folder since the last call."""
        events, self._events = self._events, []
        return events

    @property
    def waiting(self) -> int:
        """Number of complete files that are not judged."""
        return len(self._ready)

    @property
    def is_held_back(self) -> bool:
        """Always False: a logger that writes files is never held back."""
        return False

    @property
    def exhausted(self) -> bool:
        """Whether the last poll found no unjudged file, or no folder."""
        return self._has_polled and not self._candidates and not self._ready

    def close(self) -> None:
        """Do nothing: no file is held open."""

    def _poll(self) -> None:
        began = time.monotonic()
        try:
            files = nsmallest(
                self.settings.most_waiting, self._new_files(), key=lambda file: (file.modified_ns, file.name)
            )
        except OSError as error:
            self._note_lost(error)
            self._has_polled = True
            self._next_poll = time.monotonic() + self.settings.poll_s
            return
        self._note_restored()
        known, now = self._candidates, time.monotonic()
        self._candidates = {}
        for file in files:
            before = known.get(file.name)
            self._candidates[file.name] = before if before and file.same_as(before) else file
        ready = [file for file in self._candidates.values() if now - file.since >= self.settings.settle_s]
        self._ready = sorted(ready, key=self._order)
        took = time.monotonic() - began
        self._has_polled = True
        self._next_poll = time.monotonic() + max(self.settings.poll_s, took / self.settings.most_busy)

    def _new_files(self) -> Iterator[CandidateFile]:
        """Yield the files that are to be judged, or were changed after they were judged."""
        now = time.monotonic()
        files = self._all_files()
        while group := list(islice(files, AT_ONCE)):
            done = self.state.files([name for name, _ in group])
            for name, status in group:
                file, before = CandidateFile(name, status.st_size, status.st_mtime_ns, now), done.get(name)
                if before is None or before.outcome in {AGAIN, TRIED} or not file.same_as(before):
                    yield file

    def _all_files(self) -> Iterator[tuple[str, os.stat_result]]:
        with os.scandir(self.folder) as entries:
            for entry in entries:
                if entry.name.startswith(".") or Path(entry.name).suffix.lower() not in READERS:
                    continue
                try:
                    if entry.is_file():
                        yield entry.name, entry.stat()
                except FileNotFoundError:
                    continue  # deleted in the meantime
                except OSError:  # such as a circular link: the error is reported when the file is read
                    yield entry.name, entry.stat(follow_symlinks=False)

    def _order(self, file: CandidateFile) -> tuple[float, int, str]:
        """Return the sort key of a file: the flight hours in its name, if any, then its modification time."""
        pattern = self.ownership.pattern
        named = pattern.values(file.name) if pattern else {}
        return float(named.get(HOURS_LABEL, 0.0)), file.modified_ns, file.name

    def _arrival(self, candidate: CandidateFile) -> Arrival | None:
        """Return a file as an arrival, None if it was changed, deleted, or judged before."""
        path = self.folder / candidate.name
        try:
            with path.open("rb") as file:
                digest = hashlib.file_digest(file, "sha256").hexdigest()
            is_same = candidate.same(path.stat())
        except FileNotFoundError:
            return None
        except OSError as error:
            return self._unreadable(candidate, path, error)
        if not is_same:
            return None
        before = self.state.files([candidate.name]).get(candidate.name)
        if before is None or _is_open(before, digest):
            is_tried = before is not None and (before.outcome, before.digest) == (TRIED, digest)
            return self._work(candidate, path, digest, is_tried=is_tried)
        if before.digest == digest:
            self.state.finish_file(_watched_file(candidate, digest, before.outcome))
            return None
        reason = "was changed after it was judged; write new rows to a new file, or give a longer --settle"
        return self._work(candidate, path, digest, refusal=reason, outcome=CHANGED)

    def _unreadable(self, candidate: CandidateFile, path: Path, error: OSError) -> Arrival | None:
        """Return an unreadable file as an arrival that is refused, None if reading is tried again."""
        candidate.tries += 1
        if candidate.tries < self.settings.tries:
            candidate.since = time.monotonic()  # a lock or a failing network share may be temporary
            self._candidates[candidate.name] = candidate
            return None
        return self._work(candidate, path, "", refusal=f"cannot be read ({error.strerror or error})")

    def _work(
        self,
        candidate: CandidateFile,
        path: Path,
        digest: str,
        *,
        refusal: str = "",
        outcome: str = "",
        is_tried: bool = False,
    ) -> Arrival:
        def read() -> list[tuple[Entry, Recording]]:
            if refusal:
                raise RecordingError(f"{path}: {refusal}")
            recordings = self.call(read_recordings, path, self.actuator, split=self.split)
            # The pieces of a split file may belong to different units.
            return [
                (self.ownership.entry(candidate.name, recording.labels), recording)
                for recording in recordings
            ]

        def finish(judged_outcome: str, events: Sequence[Event]) -> int:
            return self.state.finish_file(_watched_file(candidate, digest, outcome or judged_outcome), events)

        def once_more() -> bool:
            nonlocal is_tried
            if is_tried:
                return False
            self.state.finish_file(_watched_file(candidate, digest, TRIED))
            is_tried = True
            return True

        return Arrival(candidate.name, read, finish, once_more, candidate.since, digest)

    def _note_lost(self, error: OSError) -> None:
        self._candidates, self._ready = {}, []
        if not self.is_lost:
            self.is_lost = True
            reason = error.strerror or error
            self._add_event(
                "raised",
                "warning",
                f"{self.folder}: cannot be read ({reason}); mount or make it again; it is looked for",
            )

    def _note_restored(self) -> None:
        if self.is_lost:
            self.is_lost = False
            self._add_event("cleared", "info", f"{self.folder}: can be read again")

    def _add_event(self, state: str, severity: str, message: str) -> None:
        self._events.append(
            Event("source_lost", state, severity, message, str(self.folder), watcher=self.state.watcher)
        )


def _watched_file(candidate: CandidateFile, digest: str, outcome: str) -> WatchedFile:
    return WatchedFile(candidate.name, candidate.size, candidate.modified_ns, digest, outcome)


def _is_open(before: WatchedFile, digest: str) -> bool:
    """Return whether a file with the content `digest`, known from `before`, must still be judged."""
    if before.digest == digest:
        return before.outcome in {AGAIN, REFUSED, TRIED}
    return before.outcome in {REFUSED, TRIED, SET_ASIDE}
