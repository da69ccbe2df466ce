"""A folder where loggers drop files: each whole file is handed over once, whatever happens in between."""

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
"""Names that the history is asked for in one query."""


@dataclass
class CandidateFile:
    """A file as it was last seen; `since` is when it was first seen so, by `time.monotonic` [s]."""

    name: str
    size: int
    modified_ns: int
    since: float
    tries: int = 0

    def same(self, found: os.stat_result) -> bool:
        """Whether the file still is what it was."""
        return (self.size, self.modified_ns) == (found.st_size, found.st_mtime_ns)

    def same_as(self, before: WatchedFile) -> bool:
        """Whether the file is as the watcher has left it, by its size and time."""
        return (self.size, self.modified_ns) == (before.size, before.modified_ns)


@dataclass(eq=False)
class FolderSource:
    """The files in a folder, without those in folders below it, hidden ones, and other endings.

    Polled, since notifications do not reach across network shares. A file is whole when it has not changed
    for `settle_s`. What is done with stands in the history.
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
    _next_look: float = 0.0
    _looked: bool = False
    _events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.state.forget_refused()

    def next(self) -> Arrival | None:
        """Return the next whole file as work; looks at the folder where it is time to."""
        if time.monotonic() >= self._next_look:
            self._look()
        while self._ready:
            candidate = self._ready.pop(0)
            self._candidates.pop(candidate.name, None)
            arrival = self._arrival(candidate)
            if arrival is not None:
                return arrival
        return None

    def events(self) -> list[Event]:
        """Return that the folder was lost or is there again, since this was last asked."""
        found, self._events = self._events, []
        return found

    @property
    def waiting(self) -> int:
        """Files that are whole and not judged."""
        return len(self._ready)

    @property
    def is_held_back(self) -> bool:
        """Never: a logger that drops files waits for nobody."""
        return False

    @property
    def exhausted(self) -> bool:
        """Whether the last look found nothing that is not judged, or no folder."""
        return self._looked and not self._candidates and not self._ready

    def close(self) -> None:
        """Nothing is held open."""

    def _look(self) -> None:
        began = time.monotonic()
        try:
            found = nsmallest(
                self.settings.most_waiting, self._new_files(), key=lambda one: (one.modified_ns, one.name)
            )
        except OSError as error:
            self._lost(error)
            self._looked = True
            self._next_look = time.monotonic() + self.settings.poll_s
            return
        self._found_again()
        known, now = self._candidates, time.monotonic()
        self._candidates = {}
        for one in found:
            before = known.get(one.name)
            is_same = before and (before.size, before.modified_ns) == (one.size, one.modified_ns)
            self._candidates[one.name] = before if before and is_same else one
        ready = [one for one in self._candidates.values() if now - one.since >= self.settings.settle_s]
        self._ready = sorted(ready, key=self._order)
        took = time.monotonic() - began
        self._looked = True
        self._next_look = time.monotonic() + max(self.settings.poll_s, took / self.settings.most_busy)

    def _new_files(self) -> Iterator[CandidateFile]:
        """Yield the files that are not done with as they are now."""
        now = time.monotonic()
        every = self._every_file()
        while group := list(islice(every, AT_ONCE)):
            done = self.state.files([name for name, _ in group])
            for name, found in group:
                one, before = CandidateFile(name, found.st_size, found.st_mtime_ns, now), done.get(name)
                if before is None or before.outcome in {AGAIN, TRIED} or not one.same_as(before):
                    yield one

    def _every_file(self) -> Iterator[tuple[str, os.stat_result]]:
        with os.scandir(self.folder) as entries:
            for entry in entries:
                if entry.name.startswith(".") or Path(entry.name).suffix.lower() not in READERS:
                    continue
                try:
                    if entry.is_file():
                        yield entry.name, entry.stat()
                except FileNotFoundError:
                    continue  # gone meanwhile
                except OSError:  # a link in a circle, for one: named by who cannot read it
                    yield entry.name, entry.stat(follow_symlinks=False)

    def _order(self, one: CandidateFile) -> tuple[float, int, str]:
        """Return where a file stands: by flight hours if its name says them, else as it was written."""
        pattern = self.ownership.pattern
        named = pattern.values(one.name) if pattern else {}
        return float(named.get(HOURS_LABEL, 0.0)), one.modified_ns, one.name

    def _arrival(self, candidate: CandidateFile) -> Arrival | None:
        """Return a file as work; None where it changed, is gone, or was judged before."""
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
            self.state.finish_file(_done(candidate, digest, before.outcome))
            return None
        reason = "was changed after it was judged; write new rows to a new file, or give a longer --settle"
        return self._work(candidate, path, digest, refusal=reason, outcome=CHANGED)

    def _unreadable(self, candidate: CandidateFile, path: Path, error: OSError) -> Arrival | None:
        """Return a file that the system refuses as work, which says so; None where it is tried again."""
        candidate.tries += 1
        if candidate.tries < self.settings.tries:
            candidate.since = time.monotonic()  # a lock or a share that fails may pass
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
            # Of a file that is cut, each piece may be another unit's.
            return [(self.ownership.entry(candidate.name, one.labels), one) for one in recordings]

        def finish(became: str, events: Sequence[Event]) -> int:
            return self.state.finish_file(_done(candidate, digest, outcome or became), events)

        def once_more() -> bool:
            nonlocal is_tried
            if is_tried:
                return False
            self.state.finish_file(_done(candidate, digest, TRIED))
            is_tried = True
            return True

        return Arrival(candidate.name, read, finish, once_more, candidate.since, digest)

    def _lost(self, error: OSError) -> None:
        self._candidates, self._ready = {}, []
        if not self.is_lost:
            self.is_lost = True
            reason = error.strerror or error
            self._say(
                "raised",
                "warning",
                f"{self.folder}: cannot be read ({reason}); mount or make it again; it is looked for",
            )

    def _found_again(self) -> None:
        if self.is_lost:
            self.is_lost = False
            self._say("cleared", "info", f"{self.folder}: can be read again")

    def _say(self, state: str, severity: str, message: str) -> None:
        self._events.append(
            Event("source_lost", state, severity, message, str(self.folder), watcher=self.state.watcher)
        )


def _done(candidate: CandidateFile, digest: str, outcome: str) -> WatchedFile:
    return WatchedFile(candidate.name, candidate.size, candidate.modified_ns, digest, outcome)


def _is_open(before: WatchedFile, digest: str) -> bool:
    """Return whether a file is still to be judged that was seen before, its content now `digest`."""
    if before.digest == digest:
        return before.outcome in {AGAIN, REFUSED, TRIED}
    return before.outcome in {REFUSED, TRIED, SET_ASIDE}
