"""Splitting a file into recordings: by columns, by the command's period, at rests, or at gaps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

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
"""Ways to cut a file other than by columns; `column:NAME` is a column with one of these names."""

LEAST_REST_S = 0.2
"""Shortest rest of a command at which a file is cut [s]; shorter ones are turning points of a manoeuvre."""

PERIODIC_DIFFERENCE = 0.1
"""Largest rms difference between a command and itself one period later, relative to its standard deviation
[-]. An error of the period of one row in 324 gives 0.02 on a trapezoid; a different manoeuvre gives 0.5 and
more."""


@dataclass(frozen=True)
class Piece:
    """Rows `start` to `stop` (exclusive) of a file, with their name, common labels and notes."""

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
    """The pieces of a file, and a sentence on each piece that was refused."""

    pieces: tuple[Piece, ...]
    refused: tuple[str, ...] = ()


def stretches(table: Table, kept: NDArray[np.bool_], longest_gap: int) -> list[Piece]:
    """Return the contiguous pieces of a file: kept rows without a long gap, with increasing times.

    Parameters
    ----------
    table
        The rows of the file.
    kept
        Whether each row is used, shape (n,).
    longest_gap
        Largest number of missing rows within a piece [rows].
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
    """Return the columns named by a way to cut, none if it cuts by something other than columns."""
    names = [part.strip().removeprefix("column:").strip() for part in by.split(",")]
    return () if by.strip() in {PERIOD, RESTS, STRETCHES} else tuple(name for name in names if name)


def cut(table: Table, kept: NDArray[np.bool_], by: str, longest_gap: int, source: str) -> Cut:
    """Return the pieces of a file.

    Parameters
    ----------
    table
        The rows of the file.
    kept
        Whether each row is used, shape (n,).
    by
        Names of columns separated by commas, "period", "rests" or "stretches".
    longest_gap
        Largest number of missing rows within a piece [rows].
    source
        The file's name, for errors.

    Raises
    ------
    RecordingError
        A column is absent, or the command has no period.
    """
    contiguous = stretches(table, kept, longest_gap)
    if by.strip() == PERIOD:
        pieces = _numbered(
            [period for piece in contiguous for period in _periods(table, piece, longest_gap, source)],
            "period",
        )
    elif by.strip() == RESTS:
        pieces = _numbered(
            [movement for piece in contiguous for movement in _between_rests(table, piece)], "movement"
        )
    elif by.strip() == STRETCHES:
        pieces = _numbered(contiguous, "stretch")
    else:
        pieces = _by_columns(table, contiguous, columns_in(by), source)
    long_enough = [piece for piece in pieces if piece.rows >= FEWEST_SAMPLES]
    refused = tuple(
        f"{source}: {piece.name} has {piece.rows} rows, at least {FEWEST_SAMPLES} are needed"
        for piece in pieces
        if piece.rows < FEWEST_SAMPLES
    )
    return Cut(tuple(long_enough), refused)


def _numbered(pieces: Sequence[Piece], kind: str) -> list[Piece]:
    return [
        replace(piece, name=f"{kind} {number}", labels=((kind, float(number)),))
        for number, piece in enumerate(pieces, 1)
    ]


def _by_columns(table: Table, contiguous: Sequence[Piece], names: Sequence[str], source: str) -> list[Piece]:
    """Return `contiguous` pieces cut where a value changes in one of the columns `names`."""
    columns = table.columns()
    split_columns = {}
    for name in names:
        column = resolved(name, list(columns), source)
        if column is None:
            raise RecordingError(
                f"{source}: no column '{name}' to cut by"
                f"{nearest(name, [*columns, PERIOD, RESTS, STRETCHES])}; correct the name"
            )
        split_columns[name] = columns[column]
    if not split_columns:
        raise RecordingError(f"{source}: nothing to cut by; name a column, or {PERIOD}, {RESTS}, {STRETCHES}")
    differs = np.logical_or.reduce([_changes(values) for values in split_columns.values()])
    pieces, occurrences = [], dict[str, int]()
    for piece in contiguous:
        inside = (np.flatnonzero(differs[piece.start : piece.stop - 1]) + piece.start + 1).tolist()
        for start, stop in zip([piece.start, *inside], [*inside, piece.stop], strict=True):
            labels = tuple((name, label_of(values[start])) for name, values in split_columns.items())
            title = ", ".join(f"{name} {_text(value)}" for name, value in labels)
            occurrences[title] = occurrences.get(title, 0) + 1
            part = f", part {occurrences[title]}" if occurrences[title] > 1 else ""
            pieces.append(Piece(start, stop, title + part, labels))
    return pieces


def _changes(values: NDArray[np.generic]) -> NDArray[np.bool_]:
    """Return whether each of `values` (n,) differs from the next one, (n - 1,); two NaN are equal."""
    differs = np.asarray(values[1:] != values[:-1], bool)
    if values.dtype.kind == "f":
        differs &= ~(np.isnan(values[1:]) & np.isnan(values[:-1]))
    return differs


def label_of(value: Any) -> Label:
    """Return a cell as the label of a recording: a text, or a number as float."""
    return value if isinstance(value, str) else float(value)


def _text(value: Label) -> str:
    return value if isinstance(value, str) else f"{value:.15g}"


def _periods(table: Table, piece: Piece, longest_gap: int, source: str) -> list[Piece]:
    """Return the periods of the command in a piece, with lost rows and short gaps interpolated."""
    rows = slice(piece.start, piece.stop)
    recorded = {name: table.channels[name][rows] for name in ("time_s", "command_rad")}
    filled, _ = without_short_gaps(with_lost_rows(recorded, longest_gap)[0], longest_gap)
    time, command = filled["time_s"], filled["command_rad"]
    period = command_period(command)
    if period is None:
        raise RecordingError(
            f"{source}: the command does not repeat itself within the {piece.rows} rows from row "
            f"{piece.start + 1}; cut at rests, or by a column"
        )
    # Time of a cut before each row, and of a cut after the last row.
    before = np.concatenate([time[:1], (time[1:] + time[:-1]) / 2, [np.nextafter(time[-1], np.inf)]])
    cuts = before[np.round(np.arange(0.0, command.size + 0.5, period)).astype(int)]
    starts = np.searchsorted(recorded["time_s"], cuts) + piece.start
    pieces = [Piece(a, b) for a, b in pairwise(starts.tolist())]
    remainder = piece.stop - int(starts[-1])
    if remainder and pieces:
        note = f"the {remainder} rows after this period are no whole one and were left out"
        pieces[-1] = replace(pieces[-1], notes=(note,))
    return pieces


@np.errstate(all="ignore")  # a command of 1e308 has no period
def command_period(command: Array) -> float | None:
    """Return the period of a command (n,) [rows], None if it does not repeat itself at least twice.

    The difference function D(L) is the mean square of x_{i + L} - x_i. The period is the first minimum of D
    after D has exceeded the variance of x, at which √D is at most `PERIODIC_DIFFERENCE` standard deviations
    of x; a parabola interpolates between rows. Unlike the autocorrelation, D has its minimum at the period
    itself for any number of periods.

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
    candidates = least[(least > beyond[0]) & (differences[least] <= PERIODIC_DIFFERENCE**2)]
    if not candidates.size:
        return None
    lag = int(candidates[0])
    before, at, after = differences[lag - 1 : lag + 2]
    return lag + float(0.5 * (before - after) / (before - 2 * at + after))


def _between_rests(table: Table, piece: Piece) -> list[Piece]:
    rows = slice(piece.start, piece.stop)
    resting = at_rest(table.channels["time_s"][rows], table.channels["command_rad"][rows], LEAST_REST_S)
    # A movement includes half of the rest before it and half of the rest after it: it begins and ends at
    # rest.
    movements = runs(~resting)
    middles = [(b + a) // 2 for (_, b), (a, _) in pairwise(movements)]
    starts = [piece.start, *(piece.start + middle for middle in middles), piece.stop]
    return [Piece(a, b) for a, b in pairwise(starts)] if movements else []
