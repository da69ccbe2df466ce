"""Errors that the user can correct: each says what is wrong, where, and what to do."""

from collections.abc import Iterable
from difflib import get_close_matches


class EmaphmError(ValueError):
    """Base of every error that the user can correct; its text is one line."""


class ActuatorError(EmaphmError):
    """An actuator description is incomplete, misspelt or physically impossible."""


class FaultError(EmaphmError):
    """A fault component is unknown or lies outside its range."""


class SignalError(EmaphmError):
    """A command, load, duration, rate or seed is malformed."""


class RecordingError(EmaphmError):
    """A recording cannot be read, or what it holds cannot be used."""


class OutputError(EmaphmError):
    """A result cannot be written where it was asked to go."""


class MethodError(EmaphmError):
    """A model, method or option is unknown or does not fit what it is used on."""


class DivergedError(MethodError):
    """A simulation did not stay finite."""


class ExecutionError(EmaphmError):
    """Workers or a scheduler cannot be used, or results cannot be kept."""


class HistoryError(EmaphmError):
    """A history cannot be opened, read or written, or what is to be added contradicts what it holds."""


class HistoryUnavailableError(HistoryError):
    """The database of a history fails, which may pass: it is held, unreachable or its disk full."""


class HistoryFormError(HistoryError):
    """A history has the form of a newer version of emaphm."""


class MonitoringError(EmaphmError):
    """What is to be watched, or where events are to go, cannot be used."""


class PrognosisError(EmaphmError):
    """Nothing can be predicted from what is given, or what a prediction is asked for is impossible."""


class ServerError(EmaphmError):
    """The server cannot be started as asked, or cannot keep what it was sent."""


class StudyError(EmaphmError):
    """A study's plan asks for what cannot be, its folder cannot be used, or some of its runs failed."""


MOST_LISTED = 20
"""Names listed in an error; a file may have thousands."""

LONGEST_LISTED = 60


def nearest(name: str, known: Iterable[str], listed_as: str = "known", alike: float = 0.5) -> str:
    """Return `` (did you mean 'x'?)`` for the known name closest to `name`, else the list of known names.

    `listed_as` is what the list begins with, `alike` the least similarity of a name that is suggested, from 0
    to 1 as in `difflib`: more where a word of another meaning may be given.
    """
    options = sorted(known)
    close = closest(name, options, alike)
    if close is not None:
        return f" (did you mean '{_short(close)}'?)"
    more = f" and {len(options) - MOST_LISTED} more" if len(options) > MOST_LISTED else ""
    return f" ({listed_as}: {', '.join(map(_short, options[:MOST_LISTED]))}{more})"


def closest(name: str, known: Iterable[str], alike: float = 0.5) -> str | None:
    """Return the known name closest to `name`, None where none is similar; capitals do not matter."""
    written = {one.lower(): one for one in known}
    close = get_close_matches(name.lower(), list(written), n=1, cutoff=alike)
    return written[close[0]] if close else None


def _short(name: str) -> str:
    return name if len(name) <= LONGEST_LISTED else f"{name[: LONGEST_LISTED - 1]}…"
