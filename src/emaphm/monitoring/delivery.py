"""Sending events: the history is the spool, and a thread of its own sends what stands there, in its order."""

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from emaphm.errors import HistoryError
from emaphm.history import Event
from emaphm.monitoring.settings import DeliverySettings
from emaphm.monitoring.watch_state import WatchState


class FailedError(Exception):
    """The receiver could not be reached, or is not ready; it may be tried again."""


class RefusedError(Exception):
    """The receiver does not take this event."""


class GoneError(Exception):
    """Nobody receives any more."""


class Receiver(Protocol):
    """Where events go."""

    @property
    def key(self) -> str:
        """What the history remembers it by."""

    @property
    def shown(self) -> str:
        """What messages call it."""

    def send(self, event: Event) -> None:
        """Send an event; `FailedError`, `RefusedError` or `GoneError` where that is not done."""


@dataclass(eq=False)
class Delivery:
    """Sends events to one receiver, at least once each, in a thread; whoever makes events never waits.

    Memory does not grow with what waits: it is read from the history, `batch` events at once.
    """

    receiver: Receiver
    state: WatchState
    settings: DeliverySettings
    say: Callable[[str], None]

    def __post_init__(self) -> None:
        self.sent, self._last = 0, -1
        self._news, self._stop = threading.Event(), threading.Event()
        self._until = float("inf")
        self._thread = threading.Thread(target=self._run, daemon=True, name=f"to {self.receiver.shown}")
        self._thread.start()

    def wake(self) -> None:
        """Say that there may be a new event."""
        self._news.set()

    def finish(self) -> None:
        """Let what is left be sent for `last_s`; the rest is left to the next run."""
        self._until = time.monotonic() + self.settings.last_s
        self._stop.set()
        self._news.set()

    def join(self) -> None:
        """Wait until it has finished, `last_s` at most, whatever answer is still missing."""
        self._thread.join(max(0.0, self._until - time.monotonic()))

    def _run(self) -> None:
        while True:
            self._news.clear()
            stopping = self._stop.is_set()
            try:
                if not self._send_all():
                    return
            except GoneError:
                return
            except HistoryError:  # said by whoever writes to it
                if stopping and time.monotonic() > self._until:
                    return
                self._pause(self.settings.first_pause_s)
                continue
            if stopping:
                return
            self._news.wait(self.settings.longest_pause_s)

    def _send_all(self) -> bool:
        """Send what the history has; return whether that was all, or the time was over before."""
        while batch := self.state.undelivered(self.receiver.key, self.settings.batch):
            for event in batch:
                if self._stop.is_set() and time.monotonic() > self._until:
                    return False
                assert event.number is not None  # noqa: S101 - it comes from the history
                # One that was sent, and could not be noted, is not sent again.
                if event.number != self._last and not self._send(event):
                    return False
                self._last = event.number
                self.state.delivered(self.receiver.key, event.number)
                self.sent += 1
        return True

    def _send(self, event: Event) -> bool:
        """Send an event, again and again; return whether it is done with."""
        pause, refused, is_said = self.settings.first_pause_s, 0, False
        while True:
            try:
                self.receiver.send(event)
            except RefusedError as error:
                refused += 1
                if refused >= self.settings.tries:
                    self.say(
                        f"{self.receiver.shown} refused event {event.number} {refused} times ({error}); it "
                        "is passed over, and stays in the history"
                    )
                    return True
            except FailedError as error:
                if not is_said:
                    self.say(f"{self.receiver.shown}: {error}; events wait in the history")
                    is_said = True
            else:
                if is_said:
                    self.say(f"{self.receiver.shown}: answers again")
                return True
            if self._stop.is_set() and time.monotonic() > self._until - pause:
                return False
            self._pause(pause)
            pause = min(2 * pause, self.settings.longest_pause_s)

    def _pause(self, seconds: float) -> None:
        """Wait, but not beyond the end."""
        if self._stop.is_set():
            time.sleep(min(seconds, max(0.0, self._until - time.monotonic())))
        else:
            self._stop.wait(seconds)


def close_all(deliveries: Sequence[Delivery]) -> None:
    """Let all finish at the same time."""
    for one in deliveries:
        one.finish()
    for one in deliveries:
        one.join()
