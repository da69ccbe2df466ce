"""Ordering of the rows of one unit by time, with late rows and clocks that are set back."""

import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

from emaphm.monitoring.stream.rows import Cells

Timed = tuple[float, int, Cells]
"""Time [s], number of arrival, row."""


@dataclass(eq=False)
class RowOrder:
    """Orders rows by time that arrive up to `depth` rows late.

    A row that is older than a row that was already passed on is left out as late. If `depth` + 1 late rows
    with increasing times arrive in succession, the clock was set back: the stored rows are passed on, and the
    times begin again.
    """

    depth: int
    last: float = -math.inf
    left_out: int = 0
    _held: list[Timed] = field(default_factory=list)
    _late: list[Timed] = field(default_factory=list)
    _count: int = 0

    def push(self, time_s: float, row: Cells) -> Iterator[tuple[float, Cells] | None]:
        """Yield the rows that are in order now; None marks a clock that was set back."""
        self._count += 1
        if time_s <= self.last:
            self._late.append((time_s, self._count, row))
            if len(self._late) > self.depth:
                yield from self._set_back()
            return
        self.left_out += len(self._late)
        self._late.clear()
        heapq.heappush(self._held, (time_s, self._count, row))
        if len(self._held) > self.depth:
            yield from self._pass_on()

    def flush(self) -> Iterator[tuple[float, Cells]]:
        """Yield all stored rows."""
        self.left_out += len(self._late)
        self._late.clear()
        while self._held:
            yield from self._pass_on()

    def _pass_on(self) -> Iterator[tuple[float, Cells]]:
        time_s, _, row = heapq.heappop(self._held)
        if time_s > self.last:
            self.last = time_s
            yield time_s, row
        else:
            self.left_out += 1  # a repeated time

    def _set_back(self) -> Iterator[tuple[float, Cells] | None]:
        late, self._late = self._late, []
        times = [time for time, _, _ in late]
        if sum(b > a for a, b in pairwise(times)) < len(times) // 2:
            self.left_out += len(late)  # old rows without order
            return
        yield from self.flush()
        yield None
        self.last = -math.inf
        for row in late:
            heapq.heappush(self._held, row)
