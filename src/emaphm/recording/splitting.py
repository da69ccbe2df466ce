"""One long file cut into recordings: by columns, by the period of its command, at its rests, at its gaps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array, runs
from emaphm.errors import RecordingError, nearest
from emaphm.recording.checks import FEWEST_SAMPLES, GAP
from emaphm.recording.conditioning.gaps import in_long_gaps, interval_of, with_lost_rows, without_short_gaps
from emaphm.recording.conditioning.masks import at_rest
from emaphm.recording.conditioning.table import Table
from emaphm.recording.io.channel_names import resolved
from emaphm.recording.recording import Label

PERIOD, RESTS, STRETCHES = "period", "rests", "stretches"
"""What a file can be cut by, besides its columns; `column:NAME` is a column that has such a name."""

LEAST_REST_S = 0.2
"""Shortest rest of a command at which a file is cut [s]; shorter ones are turning points of a manoeuvre."""

ALIKE = 0.1
"""Largest rms difference of a command and itself one period later, relative to its deviation from the mean
[-]. A period that is wrong by one row in 324 makes 0.02 on a trapezoid; an unlike manoeuvre makes 0.5 and
more."""


@dataclass(frozen=True)
class Piece:
    """Rows `start` to before `stop` of a file, what they are called, and what they have in common."""

    start: int
    stop: int
    name: str = ""
    labels: tuple[tuple[str, Label], ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.stop - self.start


@dataclass(frozen=True)
class Cut:
    """The pieces of a file, and why others are none: a sentence each."""

    pieces: tuple[Piece, ...]
    refused: tuple[str, ...] = ()


def stretches(table: Table, kept: NDArray[np.bool_], longest_gap: int) -> list[Piece]:
    """Return the rows that follow each other: kept, without a long gap, in times that go on.

    Parameters
    ----------
    table
        The rows.
    kept
        Which are used, shape (n,).
    longest_gap
        Most rows that may be missing [rows].
    """
    time = table.channels["time_s"]
    used = kept & ~in_long_gaps(table.channels, longest_gap)
    interval = interval_of(time)
    step = np.diff(time)
    most = max(GAP, longest_gap + 1.25) * interval
    breaks = np.flatnonzero(~((step > 0) & (step <= most))) + 1
    pieces = []
    for start, stop in runs(used):
        inside = breaks[(breaks > start) & (breaks < stop)].tolist()
        pieces += [Piece(a, b) for a, b in zip([start, *inside], [*inside, stop], strict=True)]
    return pieces


def columns_in(by: str) -> tuple[str, ...]:
    """Return the columns that a way to cut names, none if it is of another kind."""
    names = [one.strip().removeprefix("column:").strip() for one in by.split(",")]
    return () if by.strip() in {PERIOD, RESTS, STRETCHES} else tuple(name for name in names if name)


def cut(table: Table, kept: NDArray[np.bool_], by: str, longest_gap: int, source: str) -> Cut:
    """Return the pieces of a file.

    Parameters
    ----------
    table
        The rows of the file.
    kept
        Which of them are used, shape (n,).
    by
        Names of columns with commas between, "period", "rests" or "stretches".
    longest_gap
        Most rows that may be missing within a piece [rows].
    source
        The file's name, for errors.

    Raises
    ------
    RecordingError
        A column is absent, or the command has no period.
    """
    whole = stretches(table, kept, longest_gap)
    if by.strip() == PERIOD:
        pieces = _named(
            [one for piece in whole for one in _periods(table, piece, longest_gap, source)], "period"
        )
    elif by.strip() == RESTS:
        pieces = _named([one for piece in whole for one in _between_rests(table, piece)], "movement")
    elif by.strip() == STRETCHES:
        pieces = _named(whole, "stretch")
    else:
        pieces = _by_columns(table, whole, columns_in(by), source)
    long_enough = [one for one in pieces if one.rows >= FEWEST_SAMPLES]
    refused = tuple(
        f"{source}: {one.name} has {one.rows} rows, at least {FEWEST_SAMPLES} are needed"
        for one in pieces
        if one.rows < FEWEST_SAMPLES
    )
    return Cut(tuple(long_enough), refused)


def _named(pieces: Sequence[Piece], what: str) -> list[Piece]:
    return [
        replace(one, name=f"{what} {number}", labels=((what, float(number)),))
        for number, one in enumerate(pieces, 1)
    ]


def _by_columns(table: Table, whole: Sequence[Piece], names: Sequence[str], source: str) -> list[Piece]:
    columns = table.columns()
    found = {}
    for name in names:
        there = resolved(name, list(columns), source)
        if there is None:
            raise RecordingError(
                f"{source}: no column '{name}' to cut by"
                f"{nearest(name, [*columns, PERIOD, RESTS, STRETCHES])}; correct the name"
            )
        found[name] = columns[there]
    if not found:
        raise RecordingError(f"{source}: nothing to cut by; name a column, or {PERIOD}, {RESTS}, {STRETCHES}")
    differs = np.logical_or.reduce([_changes(values) for values in found.values()])
    pieces, seen = [], dict[str, int]()
    for one in whole:
        inside = (np.flatnonzero(differs[one.start : one.stop - 1]) + one.start + 1).tolist()
        for start, stop in zip([one.start, *inside], [*inside, one.stop], strict=True):
            labels = tuple((name, _label(values[start])) for name, values in found.items())
            called = ", ".join(f"{name} {_text(value)}" for name, value in labels)
            seen[called] = seen.get(called, 0) + 1
            part = f", part {seen[called]}" if seen[called] > 1 else ""
            pieces.append(Piece(start, stop, called + part, labels))
    return pieces


def _changes(values: NDArray[np.generic]) -> NDArray[np.bool_]:
    differs = np.asarray(values[1:] != values[:-1], bool)
    if values.dtype.kind == "f":
        differs &= ~(np.isnan(values[1:]) & np.isnan(values[:-1]))
    return differs


def _label(value: object) -> Label:
    return value if isinstance(value, str) else float(value)  # type: ignore[arg-type] # a number of numpy


def _text(value: Label) -> str:
    return value if isinstance(value, str) else f"{value:.15g}"


def _periods(table: Table, piece: Piece, longest_gap: int, source: str) -> list[Piece]:
    """Return the periods of the command in a piece; rows that are lost, and short gaps, count as if there."""
    rows = slice(piece.start, piece.stop)
    own = {name: table.channels[name][rows] for name in ("time_s", "command_rad")}
    whole, _ = without_short_gaps(with_lost_rows(own, longest_gap)[0], longest_gap)
    time, command = whole["time_s"], whole["command_rad"]
    period = command_period(command)
    if period is None:
        raise RecordingError(
            f"{source}: the command does not repeat itself within the {piece.rows} rows from row "
            f"{piece.start + 1}; cut at rests, or by a column"
        )
    # Where a cut before each row would be, and one after the last.
    before = np.concatenate([time[:1], (time[1:] + time[:-1]) / 2, [np.nextafter(time[-1], np.inf)]])
    cuts = before[np.round(np.arange(0.0, command.size + 0.5, period)).astype(int)]
    starts = np.searchsorted(own["time_s"], cuts) + piece.start
    pieces = [Piece(a, b) for a, b in pairwise(starts.tolist())]
    rest = piece.stop - int(starts[-1])
    if rest and pieces:
        pieces[-1] = replace(
            pieces[-1], notes=(f"the {rest} rows after this period are no whole one and were left out",)
        )
    return pieces


@np.errstate(all="ignore")  # a command of 1e308 has no period
def command_period(command: Array) -> float | None:
    """Return the period of a command (n,) [rows], None where it does not repeat itself at least twice.

    With the mean square D(L) of x_{i + L} - x_i, the difference function, it is the first minimum of D after
    D has exceeded the variance of x, and at which x is like itself (`ALIKE`); between rows by a parabola.
    Unlike the autocorrelation, D is least at the period itself however few periods there are.

    References
    ----------
    [1] A. de Cheveigné, H. Kawahara, YIN, a fundamental frequency estimator for speech and music, Journal of
    the Acoustical Society of America 111 (2002).
    """
    known = command[np.isfinite(command)]
    if known.size < command.size or known.size < FEWEST_SAMPLES or not np.ptp(known) > 0:
        return None
    deviation = (known - known.mean()) / known.std()
    n = deviation.size
    lags = np.arange(n // 2 + 2)
    products = np.fft.irfft(np.abs(np.fft.rfft(deviation, 2 * n)) ** 2)[lags]
    squares = np.append(0.0, np.cumsum(deviation**2))
    differences = (squares[n - lags] + squares[n] - squares[lags] - 2 * products) / (n - lags)
    beyond = np.flatnonzero(differences > 1)
    if not beyond.size:
        return None
    inner = differences[1:-1]
    least = np.flatnonzero((inner <= differences[:-2]) & (inner < differences[2:])) + 1
    found = least[(least > beyond[0]) & (differences[least] <= ALIKE**2)]
    if not found.size:
        return None
    lag = int(found[0])
    before, at, after = differences[lag - 1 : lag + 2]
    return lag + float(0.5 * (before - after) / (before - 2 * at + after))


def _between_rests(table: Table, piece: Piece) -> list[Piece]:
    rows = slice(piece.start, piece.stop)
    resting = at_rest(table.channels["time_s"][rows], table.channels["command_rad"][rows], LEAST_REST_S)
    # Each movement has half of the rest before it and half of the one after it: it begins and ends at rest.
    movements = runs(~resting)
    middles = [(b + a) // 2 for (_, b), (a, _) in pairwise(movements)]
    starts = [piece.start, *(piece.start + one for one in middles), piece.stop]
    return [Piece(a, b) for a, b in pairwise(starts)] if movements else []
