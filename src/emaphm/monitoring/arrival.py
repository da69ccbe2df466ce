"""Arrivals, the recordings that a source passes on, and the interface of a source."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ParamSpec, Protocol, TypeVar

from emaphm.history import Entry, Event
from emaphm.recording import Recording

P = ParamSpec("P")
T = TypeVar("T")


class Call(Protocol):
    """Interface that calls a function, here or in another process (`emaphm.execution.one_process.Calls`)."""

    def __call__(self, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> T:
        """Return the result of the function."""


def call_here(function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> T:
    """Return the result of a function, called in this process."""
    return function(*args, **kwargs)


@dataclass(frozen=True, eq=False)
class Arrival:
    """Recordings that have arrived.

    Attributes
    ----------
    name
        Name of the arrival in events.
    read
        Returns each recording with its entry; `RecordingError` or `HistoryError` if they cannot be used.
    finish
        Called with the outcome, one of `watch_state.OUTCOMES`, and the events to store with it; returns the
        number of new events.
    once_more
        Called if the process that judged the arrival has died or took too long: notes this, and returns
        whether the arrival is tried again. It is tried at most twice, over all runs of the watcher.
    arrived
        Time at which the last row was received, by `time.monotonic` [s].
    digest
        SHA-256 of the file's content, empty without a file.
    """

    name: str
    read: Callable[[], list[tuple[Entry, Recording]]]
    finish: Callable[[str, Sequence[Event]], int]
    once_more: Callable[[], bool]
    arrived: float
    digest: str = ""


class Source(Protocol):
    """Interface of a source of recordings."""

    def next(self) -> Arrival | None:
        """Return the next arrival, None if nothing is ready; `HistoryError` if the history fails."""

    def events(self) -> list[Event]:
        """Return the events on the source itself since the last call."""

    @property
    def waiting(self) -> int:
        """Number of known arrivals that wait."""

    @property
    def is_held_back(self) -> bool:
        """Whether the sender has to wait."""

    @property
    def exhausted(self) -> bool:
        """Whether all present recordings have been passed on; for a stream, whether it has also ended."""

    def close(self) -> None:
        """Stop watching the source."""
