"""Collection of the rows of one unit into movements from rest to rest, with limited memory."""

import hashlib
import math
from array import array
from bisect import bisect_left
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from emaphm.monitoring.settings import StreamSettings
from emaphm.recording.io.file_columns import FileColumns

AT_REST = 1e-3
"""Largest change of a command at rest, relative to its range."""


@dataclass(frozen=True, eq=False)
class Movement:
    """Rows of a unit from rest to rest.

    `first` and `last` are their times [s]; in the first `still` rows the command does not move yet.
    """

    columns: FileColumns
    first: float
    last: float
    still: int

    @property
    def rows(self) -> int:
        """Number of rows."""
        return next(iter(self.columns.numeric.values())).size

    @property
    def digest(self) -> str:
        """SHA-256 of the rows after the `still` rows, which depend on the start of the stream."""
        sha = hashlib.sha256()
        for name, values in sorted(self.columns.numeric.items()):
            sha.update(name.encode())
            sha.update(values[self.still :].tobytes())
        return sha.hexdigest()


GAPS = 5.0
"""Time step, in intervals between rows, from which a movement is cut; fewer missing rows are treated by the
reading of the recording."""


@dataclass(eq=False)
class Gathering:
    """Collects ordered rows into movements.

    Rows at rest are not stored, except the last seconds before a movement. A movement that exceeds
    `longest_s` or `most_rows` is passed on as far as it was collected; the following rows are skipped until
    the command rests, because their initial state is unknown. The same applies to rows after a gap shorter
    than `rest_s`. A longer gap is taken for a recorder that was switched off.

    The first rows are assumed to begin at rest, as those of a file, unless `waits_for_rest`. Motion is
    detected relative to the range of the command, where a value counts only if two successive rows reach it,
    because a single value may be recorded or sent wrongly.
    """

    settings: StreamSettings
    waits_for_rest: bool = False
    skipped: int = 0
    _columns: dict[str, "array[float]"] = field(default_factory=dict)
    _times: "array[float]" = field(default_factory=lambda: array("d"))
    _previous: float = math.nan
    _least: float = math.inf
    _most: float = -math.inf
    _last: float = math.nan
    _reference: float = math.nan
    _rest_from: float = 0.0
    _moves_from: float = 0.0
    _moves: bool = False

    def add(self, time_s: float, command: float, numbers: Mapping[str, float]) -> Iterator[Movement]:
        """Add a row; yield the movement that it ends, without this row if there is a gap before it."""
        yield from self._cut_at_gap(time_s)
        has_moved = self._follow(time_s, command)
        rests = self._rests(time_s)
        if self.waits_for_rest and not rests:
            self.skipped += 1
            return
        self.waits_for_rest = False
        if has_moved and not self._moves:
            self._moves, self._moves_from = True, time_s
        self._keep(time_s, numbers)
        if self._moves and rests:
            yield from self.end()
        elif self._moves and self._is_full(time_s):
            yield from self.end()
            self.waits_for_rest = True
        elif not self._moves and time_s - self._times[0] > 2 * self.settings.rest_s:
            self._forget(len(self._times) // 2)

    def pass_over(self, time_s: float, command: float) -> None:
        """Process a row that was judged before: new rows after it are skipped if it is in motion."""
        if self._follow(time_s, command):
            self.waits_for_rest = True
        elif self._rests(time_s):
            self.waits_for_rest = False

    def end(self) -> Iterator[Movement]:
        """Yield the collected rows if they are a movement, and begin a new collection."""
        if self._moves and self._times:
            numeric = {name: np.array(values) for name, values in self._columns.items()}
            still = bisect_left(self._times, self._moves_from)
            yield Movement(FileColumns(numeric, {}), self._times[0], self._times[-1], still)
        self._times, self._columns, self._moves = array("d"), {}, False

    def interrupt(self) -> Iterator[Movement]:
        """Yield the collected rows, as `end`; after a movement, rows are skipped until the next rest."""
        was_moving = self._moves
        yield from self.end()
        self.waits_for_rest = self.waits_for_rest or was_moving

    def _cut_at_gap(self, time_s: float) -> Iterator[Movement]:
        step = time_s - self._previous
        rows = len(self._times)
        if step >= self.settings.rest_s:
            yield from self.end()
            self._reference, self.waits_for_rest = math.nan, False
        elif rows > 1 and step > GAPS * (self._times[-1] - self._times[0]) / (rows - 1):
            yield from self.interrupt()
            self._rest_from = time_s

    def _follow(self, time_s: float, command: float) -> bool:
        """Return whether the command has moved, and note the time since which it rests."""
        self._previous = time_s
        if not math.isnan(self._last):
            self._least = min(self._least, max(command, self._last))
            self._most = max(self._most, min(command, self._last))
        self._last = command
        is_first = math.isnan(self._reference)
        if not is_first and abs(command - self._reference) <= AT_REST * max(self._most - self._least, 0.0):
            return False
        self._reference, self._rest_from = command, time_s
        return not is_first

    def _rests(self, time_s: float) -> bool:
        return time_s - self._rest_from >= self.settings.rest_s

    def _keep(self, time_s: float, numbers: Mapping[str, float]) -> None:
        if not self._times:
            self._columns = {name: array("d") for name in numbers}
        self._times.append(time_s)
        for name, values in self._columns.items():
            values.append(numbers.get(name, math.nan))

    def _is_full(self, time_s: float) -> bool:
        s = self.settings
        return len(self._times) >= s.most_rows or time_s - self._times[0] >= s.longest_s

    def _forget(self, rows: int) -> None:
        self._times = self._times[rows:]
        self._columns = {name: values[rows:] for name, values in self._columns.items()}
