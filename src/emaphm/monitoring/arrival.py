"""A piece of work that a source hands over: recordings of one unit and flight."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from emaphm.history import Entry, Event
from emaphm.recording import Recording


@dataclass(frozen=True, eq=False)
class Arrival:
    """Recordings that have arrived.

    Attributes
    ----------
    name
        What events call them.
    read
        Returns the entry and the recordings; `RecordingError` or `HistoryError` where they cannot be used.
    finish
        Called with the outcome, "judged" or "refused", and events to be kept with it.
    arrived
        When the last row was there, by `time.monotonic` [s].
    digest
        SHA-256 of the file's content, empty where there is none.
    """

    name: str
    read: Callable[[], tuple[Entry, list[Recording]]]
    finish: Callable[[str, Sequence[Event]], None]
    arrived: float
    digest: str = ""


class Source(Protocol):
    """Where recordings come from."""

    def next(self) -> Arrival | None:
        """Return what is to be judged next, None where nothing is ready; `HistoryError` as usual."""

    def events(self) -> list[Event]:
        """Return what became known of the source itself since it was last asked."""

    @property
    def waiting(self) -> int:
        """How many pieces of work wait, as far as is known."""

    @property
    def is_held_back(self) -> bool:
        """Whether the sender has to wait."""

    @property
    def exhausted(self) -> bool:
        """Whether nothing is there that is not judged, now; of a stream that has ended, for ever."""

    def close(self) -> None:
        """Stop looking."""
