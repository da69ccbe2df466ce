"""When a recording is like no model: all the time, or once, as where two runs are joined or a blow falls."""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.search_result import SearchResult


@dataclass(frozen=True)
class MomentSettings:
    """From when on a residual is one of a moment.

    Within `window`, a share of the recording and `rows` at least, lies more than `residual` of its square,
    and less than `motion` of what the command moves: where a command moves once, so does the residual. The
    moment has all of the window's residual but `ends` of it at either end.
    """

    window: float = 0.05
    rows: int = 10
    residual: float = 0.6
    motion: float = 0.3
    ends: float = 0.05


MOMENT = MomentSettings()


def notes_on_moment(result: SearchResult) -> tuple[str, ...]:
    """Return a sentence on when an estimate that does not explain its recording deviates from it, or none."""
    problem = result.objective.problem
    residual = result.fitted_residual[: problem.samples]
    squares = np.where(problem.unusable.get(problem.primary, False), 0.0, residual**2)
    began = moment_of(squares, np.asarray(problem.measured["command_rad"]))
    if began is None:
        return ()
    first, last = (float(problem.inputs.time_s[row]) for row in began)
    when = f"{first:.4g} s" if first == last else f"{first:.4g} to {last:.4g} s"
    note = (
        f"the residual of {problem.primary} is of one moment, {when} after the first row: no fault acts for "
        "so short a time; if two runs are joined there, or a blow fell, cut the recording and diagnose the "
        "parts"
    )
    return (note,)


def moment_of(squares: Array, command: Array) -> tuple[int, int] | None:
    """Return the first and last row of the moment that the residual is of; None where it is of none.

    Parameters
    ----------
    squares
        Of the residual, (samples,).
    command
        In the same rows, (samples,).
    """
    rows = max(round(MOMENT.window * squares.size), MOMENT.rows)
    if rows >= squares.size or not squares.any():
        return None
    first = int(np.argmax(_sums(squares, rows)))
    moved = np.abs(np.diff(command, prepend=command[:1]))
    within = slice(first, first + rows)
    is_large = squares[within].sum() > MOMENT.residual * squares.sum()
    is_of_motion = moved[within].sum() >= MOMENT.motion * moved.sum()
    if not is_large or is_of_motion:
        return None
    shares = np.cumsum(squares[within]) / squares[within].sum()
    begin, end = (int(np.searchsorted(shares, share)) for share in (MOMENT.ends, 1 - MOMENT.ends))
    return first + begin, first + end


def _sums(values: Array, rows: int) -> Array:
    """Return the sum of each `rows` values in turn, (n - rows + 1,)."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    sums: Array = total[rows:] - total[:-rows]
    return sums
