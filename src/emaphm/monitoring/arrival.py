"""A piece of work that a source hands over: recordings of one unit and flight."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ParamSpec, Protocol, TypeVar

from emaphm.history import Entry, Event
from emaphm.recording import Recording

P = ParamSpec("P")
T = TypeVar("T")


class Call(Protocol):
    """Calls a function, here or in a process of its own (`emaphm.execution.one_process.Calls`)."""

    def __call__(self, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> T:
        """Return what it returns."""


def call_here(function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> T:
    """Return what a function returns that is called in this process."""
    return function(*args, **kwargs)


@dataclass(frozen=True, eq=False)
class Arrival:
    """Recordings that have arrived.

    Attributes
    ----------
    name
        What events call them.
    read
        Returns each recording with its entry; `RecordingError` or `HistoryError` where they cannot be used.
    finish
        Called with the outcome, one of `watch_state.OUTCOMES`, and events to be kept with it; returns how
        many of them are new.
    once_more
        Called where the process that judged it has died of it, or took too long: notes that, and returns
        whether it is to be tried again. It is tried twice at most, over all runs of the watcher.
    arrived
        When the last row was there, by `time.monotonic` [s].
    digest
        SHA-256 of the file's content, empty where there is none.
    """

    name: str
    read: Callable[[], list[tuple[Entry, Recording]]]
    finish: Callable[[str, Sequence[Event]], int]
    once_more: Callable[[], bool]
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
