"""Delivery of events: a separate thread sends the events stored in the history, in their order."""

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
    """The receiver could not be reached, or is not ready; sending may be tried again."""


class RefusedError(Exception):
    """The receiver does not accept this event."""


class GoneError(Exception):
    """The receiver has closed for ever."""


class Receiver(Protocol):
    """Interface of a receiver of events."""

    @property
    def key(self) -> str:
        """Identifier of the receiver in the history."""

    @property
    def shown(self) -> str:
        """Name of the receiver in messages."""

    def send(self, event: Event) -> None:
        """Send an event; `FailedError`, `RefusedError` or `GoneError` if it was not received."""


@dataclass(eq=False)
class Delivery:
    """Sends each event at least once to a receiver, in a thread; the diagnosis never waits for it.

    Memory does not depend on the number of waiting events, of which `batch` are read from the history at
    once.
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
        """Notify the thread that there may be a new event."""
        self._news.set()

    def finish(self) -> None:
        """Continue sending for `last_s` only; the remaining events are sent in the next run."""
        self._until = time.monotonic() + self.settings.last_s
        self._stop.set()
        self._news.set()

    def join(self) -> None:
        """Wait until the thread has finished, at most `last_s`, even if an answer is pending."""
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
            except HistoryError:  # reported by the thread that writes to it
                if stopping and time.monotonic() > self._until:
                    return
                self._pause(self.settings.first_pause_s)
                continue
            if stopping:
                return
            self._news.wait(self.settings.longest_pause_s)

    def _send_all(self) -> bool:
        """Send all undelivered events; return False if the time is over before."""
        while batch := self.state.undelivered(self.receiver.key, self.settings.batch):
            for event in batch:
                if self._stop.is_set() and time.monotonic() > self._until:
                    return False
                assert event.number is not None  # noqa: S101 - it comes from the history
                # An event that was sent but could not be noted as delivered is not sent again.
                if event.number != self._last and not self._send(event):
                    return False
                self._last = event.number
                self.state.delivered(self.receiver.key, event.number)
                self.sent += 1
        return True

    def _send(self, event: Event) -> bool:
        """Send an event, with repeated attempts; return whether it was sent or finally refused."""
        pause, refused, is_reported = self.settings.first_pause_s, 0, False
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
                if not is_reported:
                    self.say(f"{self.receiver.shown}: {error}; events wait in the history")
                    is_reported = True
            else:
                if is_reported:
                    self.say(f"{self.receiver.shown}: answers again")
                return True
            if self._stop.is_set() and time.monotonic() > self._until - pause:
                return False
            self._pause(pause)
            pause = min(2 * pause, self.settings.longest_pause_s)

    def _pause(self, seconds: float) -> None:
        """Wait for `seconds`, but not beyond the end."""
        if self._stop.is_set():
            time.sleep(min(seconds, max(0.0, self._until - time.monotonic())))
        else:
            self._stop.wait(seconds)


def close_all(deliveries: Sequence[Delivery]) -> None:
    """Finish all deliveries at the same time."""
    for delivery in deliveries:
        delivery.finish()
    for delivery in deliveries:
        delivery.join()
