"""A stream of rows on a pipe as a source; a thread reads rows, collects movements, holds the sender back."""

import math
import os
import queue
import select
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from emaphm.actuator import Actuator
from emaphm.actuator.channels import ChannelEntry
from emaphm.errors import HistoryError, MonitoringError, RecordingError
from emaphm.history import Entry, Event
from emaphm.monitoring.arrival import Arrival, Call, call_here
from emaphm.monitoring.ownership import CYCLES_LABEL, HOURS_LABEL, ROW, UNIT_LABELS, Ownership
from emaphm.monitoring.settings import StreamSettings
from emaphm.monitoring.stream.movements import Gathering, Movement
from emaphm.monitoring.stream.row_order import RowOrder
from emaphm.monitoring.stream.rows import Cells, RowParser
from emaphm.monitoring.watch_state import SET_ASIDE, TRIED, RowsJudged, WatchedFile, WatchState
from emaphm.recording import Recording, recordings_of

AT_ONCE = 65_536
"""Number of bytes that are read at once."""

STOP_S = 0.2
"""Time between two checks whether reading must stop [s]."""

REPORT_EVERY_S = 60.0
"""Least time between two events on rows that were left out [s]."""

MOST_ENTRIES = 1000
"""Largest number of cached entries, checked combinations of unit and hours."""

ABOUT_UNIT = (*UNIT_LABELS, HOURS_LABEL, CYCLES_LABEL)


@dataclass(frozen=True, eq=False)
class _Ended:
    """A completed movement with its entry; `arrived` is the time at which its last row was read."""

    movement: Movement
    entry: Entry
    arrived: float


@dataclass(eq=False)
class _Flight:
    """State of a unit on one flight."""

    entry: Entry
    order: RowOrder
    gathering: Gathering
    judged: RowsJudged | None
    read_at: float = 0.0

    def moves_until(self, time_s: float, rest_s: float) -> bool:
        """Return whether a row at this time continues a motion, or rows that were left out."""
        return self.gathering.waits_for_rest and 0 < time_s - self.order.last < rest_s


@dataclass(eq=False)
class StreamSource:
    """The rows on a file descriptor as a source.

    A row has the columns of a recording, and the columns "unit", "hours" and "cycles" if the command line
    does not give them. Rows that an earlier run has judged are skipped, up to the first newer row.
    """

    descriptor: int
    actuator: Actuator
    ownership: Ownership
    state: WatchState
    settings: StreamSettings
    split: str | None = None
    call: Call = call_here

    def __post_init__(self) -> None:
        for name in ("time_s", "command_rad"):
            if self.actuator.channels.entry(name).derived is not None:
                raise MonitoringError(
                    f"a stream needs {name} as a column, [channels] derives it; send the column, or watch a "
                    "folder of files"
                )
        self._parser = RowParser(self.settings.longest_line)
        self._queue: queue.Queue[_Ended] = queue.Queue(self.settings.queue)
        self._taken: _Ended | None = None
        self._judged: dict[str, RowsJudged | None] = {**self.state.rows_judged()}
        self._entries: dict[tuple[object, ...], Entry | str] = {}
        self._seconds = _seconds(self.actuator.channels.time_s)
        self._flights: dict[str, _Flight] = {}
        self._replaced: dict[str, _Flight] = {}
        self._skipped: dict[str, int] = {}
        self._reported_at = -math.inf
        self._is_held_back = False
        self._lock = threading.Lock()
        self._stop, self._ended = threading.Event(), threading.Event()
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, daemon=True, name="rows")
        self._thread.start()

    def next(self) -> Arrival | None:
        """Return the next movement as an arrival, None if there is none or it was set aside."""
        try:
            self._taken = self._taken or self._queue.get_nowait()
        except queue.Empty:
            if self._failure is not None:
                raise self._failure from None
            return None
        arrival = self._arrival(self._taken)
        self._taken = None  # not earlier: if the history fails, this movement is returned by the next call
        return arrival

    def events(self) -> list[Event]:
        """Return the event on rows that were left out since the last such event."""
        now = time.monotonic()
        with self._lock:
            if not self._skipped or (now - self._reported_at < REPORT_EVERY_S and not self._ended.is_set()):
                return []
            skipped, self._skipped, self._reported_at = self._skipped, {}, now
        reasons = "; ".join(f"{reason} ({count})" for reason, count in skipped.items())
        explanation = next(iter(skipped)) if len(skipped) == 1 else reasons
        message = f"{sum(skipped.values())} rows were left out: {explanation}"
        return [
            Event("rows_skipped", "raised", "warning", message, details=skipped, watcher=self.state.watcher)
        ]

    @property
    def waiting(self) -> int:
        """Number of movements that wait to be judged."""
        return self._queue.qsize()

    @property
    def is_held_back(self) -> bool:
        """Whether the sender has to wait because the queue of movements is full."""
        return self._is_held_back and self._queue.qsize() >= self.settings.queue - 1

    @property
    def exhausted(self) -> bool:
        """Whether the stream has ended and all movements were passed on."""
        return self._ended.is_set() and self._queue.empty() and self._failure is None

    def close(self) -> None:
        """Stop reading."""
        self._stop.set()
        self._thread.join(2 * STOP_S)

    def _arrival(self, ended: _Ended) -> Arrival | None:
        """Return a movement as an arrival, None if an earlier run has set it aside."""
        movement, entry = ended.movement, ended.entry
        name = f"{entry.unit} at {entry.hours:.9g} h, {movement.first:.3f} to {movement.last:.3f} s"

        def read() -> list[tuple[Entry, Recording]]:
            pieces = self.call(recordings_of, movement.columns, name, self.actuator, split=self.split)
            return [(entry, piece) for piece in pieces]

        before = self.state.files([(key := _key(ended))]).get(key)
        was_tried = before is not None and before.digest == movement.digest
        if was_tried and before is not None and before.outcome == SET_ASIDE:
            self.state.finish_rows(entry.unit, self._judged_by(ended))
            self._skip("of a movement that is set aside", movement.rows)
            return None

        def with_outcome(outcome: str) -> WatchedFile:
            return WatchedFile(key, movement.rows, 0, movement.digest, outcome)

        def finish(outcome: str, events: Sequence[Event]) -> int:
            tried = with_outcome(outcome) if was_tried else None
            return self.state.finish_rows(entry.unit, self._judged_by(ended), events, tried)

        def once_more() -> bool:
            nonlocal was_tried
            if was_tried:
                return False
            self.state.finish_file(with_outcome(TRIED))
            was_tried = True
            return True

        return Arrival(name, read, finish, once_more, ended.arrived)

    def _judged_by(self, ended: _Ended) -> RowsJudged | None:
        """Return the judged rows of the unit after a movement, None if a later flight was already judged."""
        entry, last = ended.entry, ended.movement.last
        before = self.state.rows_judged().get(entry.unit)
        if before is not None and before.hours > entry.hours:
            return None
        if before is not None and before.hours == entry.hours:
            last = max(last, before.time_s)  # the clock may have been set back
        return RowsJudged(entry.hours, last)

    def _run(self) -> None:
        """Read until the stream ends."""
        try:
            for content in self._contents():
                for row in self._parser.feed(content):
                    self._row(row)
                self._count_lines()
            for row in self._parser.end():
                self._row(row)
            self._count_lines()
            self._end_all()
        except _StoppedError:
            pass
        except BaseException as error:  # noqa: BLE001 - raised in the main thread
            self._failure = error
        self._ended.set()

    def _contents(self) -> Iterator[bytes]:
        read_at, idle = time.monotonic(), False
        while True:
            if self._stop.is_set():
                raise _StoppedError
            if not select.select([self.descriptor], [], [], STOP_S)[0]:
                if not idle and time.monotonic() - read_at > self.settings.idle_s:
                    for flight in self._flights.values():
                        self._hand_over_rest(flight)
                    idle = True
                continue
            content = os.read(self.descriptor, AT_ONCE)
            if not content:
                return
            read_at, idle = time.monotonic(), False
            yield content

    def _row(self, row: Cells) -> None:
        time_s, command = self._time(row), row.get(self._column("command_rad", row))
        if time_s is None or not isinstance(command, float) or not math.isfinite(command):
            self._skip("without a time or a command")
            return
        entry = self._entry(row)
        if isinstance(entry, str):
            self._skip(entry)
            return
        flight = self._flight(entry, time_s)
        if flight is None:
            self._skip(f"of more than {self.settings.most_units} units at once")
            return
        flight.read_at = time.monotonic()
        if flight.judged is not None:
            if flight.judged.covers(entry.hours, time_s):
                flight.gathering.pass_over(time_s, command)
                self._skip("that were judged before")
                return
            flight.judged = self._judged[entry.unit] = None
        for passed in flight.order.push(time_s, row):
            if passed is None:
                self._skip("where a clock was set back; a new recording begins", 1)
                self._hand_over(flight, flight.gathering.end())
                flight.gathering = Gathering(self.settings)
            else:
                self._gather(flight, *passed)

    def _entry(self, row: Cells) -> Entry | str:
        """Return the entry of a row, or the reason why it is not known."""
        key = tuple(row.get(name) for name in ABOUT_UNIT)
        if key not in self._entries:
            if len(self._entries) > MOST_ENTRIES:
                self._entries.clear()
            labels = {name: row[name] for name in ABOUT_UNIT if _is_given(row.get(name))}
            try:
                self._entries[key] = self.ownership.entry(ROW, labels)
            except RecordingError as error:
                self._entries[key] = str(error).removeprefix(f"{ROW}: ").replace("its", "their", 1)
            except HistoryError as error:
                self._entries[key] = str(error)
        return self._entries[key]

    def _flight(self, entry: Entry, time_s: float) -> _Flight | None:
        """Return the flight of a unit, after ending its previous flight; None if there is no place for it."""
        current = self._flights.get(entry.unit)
        if current is not None and current.entry.hours == entry.hours:
            return current
        if current is not None:
            self._end(current)
        elif not self._has_place(entry, time_s):
            return None
        before = current or self._replaced.pop(entry.unit, None)
        waits = before is not None and before.moves_until(time_s, self.settings.rest_s)
        gathering = Gathering(self.settings, waits_for_rest=waits)
        judged = self._judged.get(entry.unit)
        if judged is not None and judged.hours < entry.hours:
            judged = None
        last = judged.time_s if judged is not None and judged.hours == entry.hours else -math.inf
        flight = _Flight(entry, RowOrder(self.settings.reorder_rows, last), gathering, judged)
        self._flights[entry.unit] = flight
        return flight

    def _has_place(self, entry: Entry, time_s: float) -> bool:
        """Return whether there is a place for a further unit, if necessary by ending the least recent flight.

        A unit that returns in the flight in which it was replaced has no place while rows of the other units
        arrive: else the units would replace each other, and no movement would be complete.
        """
        if len(self._flights) < self.settings.most_units:
            return True
        oldest = min(self._flights.values(), key=lambda flight: flight.read_at)
        returning = self._replaced.get(entry.unit)
        is_read = time.monotonic() - oldest.read_at < self.settings.idle_s
        if returning is not None and returning.entry.hours == entry.hours and is_read:
            returning.order.last, returning.gathering.waits_for_rest = time_s, True
            return False
        self._end(oldest)
        self._replaced[oldest.entry.unit] = oldest
        return True

    def _gather(self, flight: _Flight, time_s: float, row: Cells) -> None:
        command = row[self._column("command_rad", row)]
        numbers = {name: value for name, value in row.items() if isinstance(value, float)}
        assert isinstance(command, float)  # noqa: S101 - for the type checker, checked in `_row`
        skipped = flight.gathering.skipped
        self._hand_over(flight, flight.gathering.add(time_s, command, numbers))
        self._skip("in a movement whose beginning is not known", flight.gathering.skipped - skipped)

    def _hand_over(self, flight: _Flight, movements: Iterator[Movement]) -> None:
        for movement in movements:
            ended = _Ended(movement, flight.entry, flight.read_at)
            self._is_held_back = self._queue.full()
            while True:
                try:
                    self._queue.put(ended, timeout=STOP_S)
                    break
                except queue.Full:
                    if self._stop.is_set():
                        raise _StoppedError from None

    def _end(self, flight: _Flight) -> None:
        self._hand_over_rest(flight)
        self._skip("late, or with a time that was there before", flight.order.left_out)
        del self._flights[flight.entry.unit]

    def _hand_over_rest(self, flight: _Flight) -> None:
        """Pass on the rows in memory, although further rows may follow."""
        for passed in flight.order.flush():
            self._gather(flight, *passed)
        self._hand_over(flight, flight.gathering.interrupt())

    def _end_all(self) -> None:
        for flight in list(self._flights.values()):
            self._end(flight)

    def _time(self, row: Cells) -> float | None:
        """Return the time of a row [s], None if it has none."""
        name = self._column("time_s", row)
        raw = row.get(name)
        if not isinstance(raw, float) or not math.isfinite(raw):
            return None
        return raw * self._seconds if name == (self.actuator.channels.time_s.column or "time_s") else raw

    def _column(self, channel: str, row: Cells) -> str:
        """Return the column of a channel in a row: the name in [channels] if present, else its own name."""
        named = self.actuator.channels.entry(channel).column
        return named if named is not None and named in row else channel

    def _count_lines(self) -> None:
        for reason, count in self._parser.skipped.items():
            self._skip(reason, count)
        self._parser.skipped.clear()

    def _skip(self, reason: str, count: int = 1) -> None:
        if count:
            with self._lock:
                self._skipped[reason] = self._skipped.get(reason, 0) + count


def _key(ended: _Ended) -> str:
    """Return the identifier of a tried movement in the history: unit, hours and end, the same in each run."""
    return f"{ended.entry.unit} at {ended.entry.hours!r} h, to {ended.movement.last!r} s"


class _StoppedError(Exception):
    """Reading was stopped."""


def _is_given(value: float | str | None) -> bool:
    return value is not None and value == value  # noqa: PLR0124 - NaN is an empty cell


def _seconds(entry: ChannelEntry) -> float:
    """Return the length of one unit of the raw time [s]."""
    import numpy as np

    from emaphm.actuator.columns.units import in_unit

    factor = entry.sign * entry.scale
    if entry.unit is None:
        return factor
    return factor * float(in_unit(np.ones(1), entry.unit, "s")[0])
