"""Detection of a residual concentrated in one moment: two runs joined in one recording, or an impact."""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.search_result import SearchResult


@dataclass(frozen=True)
class MomentSettings:
    """Limits from which a residual is concentrated in one moment.

    A `window`, a share of the recording with at least `rows`, contains more than `residual` of the squared
    residual, and less than `motion` of the command's path: if a command moves only once, the residual is also
    concentrated there. The moment contains the window's squared residual except a share of `ends` at each
    end.
    """

    window: float = 0.05
    rows: int = 10
    residual: float = 0.6
    motion: float = 0.3
    ends: float = 0.05


MOMENT = MomentSettings()


def notes_on_moment(result: SearchResult) -> tuple[str, ...]:
    """Return a sentence on the moment in which the residual is concentrated, if there is one."""
    problem = result.objective.problem
    residual = result.fitted_residual[: problem.samples]
    squares = np.where(problem.unusable.get(problem.primary, False), 0.0, residual**2)
    moment = moment_of(squares, np.asarray(problem.measured["command_rad"]))
    if moment is None:
        return ()
    first, last = (float(problem.inputs.time_s[row]) for row in moment)
    when = f"{first:.4g} s" if first == last else f"{first:.4g} to {last:.4g} s"
    note = (
        f"the residual of {problem.primary} is concentrated in one moment, {when} after the first row: no "
        "fault acts for such a short time; if two runs are joined there, or the actuator was hit, cut the "
        "recording and diagnose the parts"
    )
    return (note,)


def moment_of(squares: Array, command: Array) -> tuple[int, int] | None:
    """Return the first and last row of the moment in which the residual is concentrated; None without one.

    Parameters
    ----------
    squares
        Squared residual, (samples,).
    command
        Command in the same rows, (samples,).
    """
    rows = max(round(MOMENT.window * squares.size), MOMENT.rows)
    if rows >= squares.size or not squares.any():
        return None
    first = int(np.argmax(_moving_sums(squares, rows)))
    moved = np.abs(np.diff(command, prepend=command[:1]))
    window = slice(first, first + rows)
    is_large = squares[window].sum() > MOMENT.residual * squares.sum()
    is_of_motion = moved[window].sum() >= MOMENT.motion * moved.sum()
    if not is_large or is_of_motion:
        return None
    shares = np.cumsum(squares[window]) / squares[window].sum()
    begin, end = (int(np.searchsorted(shares, share)) for share in (MOMENT.ends, 1 - MOMENT.ends))
    return first + begin, first + end


def _moving_sums(values: Array, rows: int) -> Array:
    """Return the moving sums over `rows` values, (n - rows + 1,)."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    sums: Array = total[rows:] - total[:-rows]
    return sums
