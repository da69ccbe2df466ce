"""Back-pressure: detection of recordings that arrive faster than they are judged."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from emaphm.history import Event
from emaphm.monitoring.arrival import Source
from emaphm.monitoring.settings import PressureSettings

WEIGHT = 0.2
"""Weight of the last duration in the exponential mean of durations."""


@dataclass(eq=False)
class Pressure:
    """Raises an event once when the waiting time is too long, and clears it once when it is short again."""

    settings: PressureSettings
    watcher: str
    is_raised: bool = False
    mean_s: float = 0.0

    @contextmanager
    def measured(self) -> Iterator[None]:
        """Measure the duration of the body, which is that of one arrival."""
        began = time.monotonic()
        yield
        took = time.monotonic() - began
        self.mean_s = took if not self.mean_s else (1 - WEIGHT) * self.mean_s + WEIGHT * took

    def events(self, source: Source) -> list[Event]:
        """Return the event if back-pressure was raised or cleared since the last call."""
        expected = source.waiting * self.mean_s
        if not self.is_raised and (expected > self.settings.raise_s or source.is_held_back):
            self.is_raised = True
            held = "; the sender of the stream is held back" if source.is_held_back else ""
            return [self._event("raised", "warning", source, expected, held)]
        if self.is_raised and expected < self.settings.clear_s and not source.is_held_back:
            self.is_raised = False
            return [self._event("cleared", "info", source, expected)]
        return []

    def _event(self, state: str, severity: str, source: Source, expected: float, held: str = "") -> Event:
        each = f"{expected:.0f} s at {self.mean_s:.2g} s each"
        message = f"{source.waiting} recordings wait, which takes {each}{held}"
        details = {"waiting": source.waiting, "expected_s": expected, "seconds_each": self.mean_s}
        return Event(
            "back_pressure", state, severity, message, self.watcher, details=details, watcher=self.watcher
        )
