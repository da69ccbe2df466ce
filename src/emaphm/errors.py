"""Errors that the user can correct: each message names the problem, its place, and the remedy."""

from collections.abc import Iterable
from difflib import get_close_matches


class EmaphmError(ValueError):
    """Base class of all errors that the user can correct; the message is one line."""


class ActuatorError(EmaphmError):
    """An actuator description is incomplete, misspelt or physically impossible."""


class FaultError(EmaphmError):
    """A fault component is unknown or lies outside its range."""


class SignalError(EmaphmError):
    """A command, load, duration, rate or seed is malformed."""


class RecordingError(EmaphmError):
    """A recording cannot be read, or its content cannot be used."""


class OutputError(EmaphmError):
    """A result cannot be written to the given place."""


class MethodError(EmaphmError):
    """A model, method or option is unknown, or not applicable to the data or to another option."""


class DivergedError(MethodError):
    """A simulation did not stay finite."""


class ExecutionError(EmaphmError):
    """Workers or a scheduler cannot be used, or results cannot be stored."""


class HistoryError(EmaphmError):
    """A history cannot be opened, read or written, or a new entry contradicts its content."""


class HistoryUnavailableError(HistoryError):
    """The database of a history fails, maybe temporarily: it is locked, unreachable, or its disk is full."""


class HistoryFormError(HistoryError):
    """A history has the format of a newer version of emaphm."""


class MonitoringError(EmaphmError):
    """The source to be watched, or the destination of events, cannot be used."""


class PrognosisError(EmaphmError):
    """The data do not permit a prediction, or a setting of the prediction is invalid."""


class ServerError(EmaphmError):
    """The server cannot be started with the given options, or cannot store an upload."""


class StudyError(EmaphmError):
    """The plan of a study is invalid, its folder cannot be used, or some of its runs failed."""


MOST_LISTED = 20
"""Largest number of names listed in an error; a file may have thousands."""

LONGEST_LISTED = 60
"""Length to which a listed name is shortened [characters]."""


def nearest(name: str, known: Iterable[str], listed_as: str = "known", alike: float = 0.5) -> str:
    """Return `` (did you mean 'x'?)`` for the known name closest to `name`, or the list of known names.

    `listed_as` is the first word of the list. `alike` is the smallest similarity of a suggested name, 0 to 1
    as in `difflib`; a larger value is used where `name` may be a word of another meaning.
    """
    options = sorted(known)
    close = closest(name, options, alike)
    if close is not None:
        return f" (did you mean '{_short(close)}'?)"
    more = f" and {len(options) - MOST_LISTED} more" if len(options) > MOST_LISTED else ""
    return f" ({listed_as}: {', '.join(map(_short, options[:MOST_LISTED]))}{more})"


def closest(name: str, known: Iterable[str], alike: float = 0.5) -> str | None:
    """Return the known name closest to `name`, ignoring case; None if no name is similar."""
    by_lower_case = {candidate.lower(): candidate for candidate in known}
    close = get_close_matches(name.lower(), list(by_lower_case), n=1, cutoff=alike)
    return by_lower_case[close[0]] if close else None


def _short(name: str) -> str:
    return name if len(name) <= LONGEST_LISTED else f"{name[: LONGEST_LISTED - 1]}…"
