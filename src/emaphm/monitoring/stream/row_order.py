"""Rows of one unit in the order of their times, though some come late or the clock is set back."""

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
    """Puts rows in order that come up to `depth` rows late.

    A row that is older than one that was passed on is late and left out. If `depth` + 1 late rows come in
    succession, which rise, the clock was set back: what is held is passed on, and the times begin again.
    """

    depth: int
    last: float = -math.inf
    left_out: int = 0
    _held: list[Timed] = field(default_factory=list)
    _late: list[Timed] = field(default_factory=list)
    _count: int = 0

    def push(self, time_s: float, row: Cells) -> Iterator[tuple[float, Cells] | None]:
        """Yield the rows that are in order now; None stands where the clock was set back."""
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
        """Yield all that is held."""
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
            self.left_out += 1  # the same time once more

    def _set_back(self) -> Iterator[tuple[float, Cells] | None]:
        late, self._late = self._late, []
        times = [time for time, _, _ in late]
        if sum(b > a for a, b in pairwise(times)) < len(times) // 2:
            self.left_out += len(late)  # old rows in no order
            return
        yield from self.flush()
        yield None
        self.last = -math.inf
        for one in late:
            heapq.heappush(self._held, one)
