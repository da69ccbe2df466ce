"""Resampling of rows whose times jitter to a constant rate."""

import numpy as np

from emaphm.actuator.channels import Sampling
from emaphm.arrays import Array
from emaphm.recording.checks import is_uniform
from emaphm.recording.conditioning.interpolation import HELD, continuous, curve, edges_of

Columns = dict[str, Array]


def on_uniform_grid(columns: Columns, sampling: Sampling) -> tuple[Columns, tuple[str, ...]]:
    """Return `columns` on the same number of equally spaced times, and a note; unchanged if already uniform.

    Instants are interpolated by a piecewise cubic curve (Akima 1970). A straight line would have the error
    h²x''/8 half-way between two rows. A spline through all rows would overshoot far around a jump; Akima's
    curve depends on three rows on either side and follows a jump closely.

    Means over [t_n, t_{n+1}) are interpolated through their integral F(t_n) = Σ_{k<n} x̄_k (t_{k+1} - t_k),
    which preserves the time integral of each channel: a new row is (F(τ_{n+1}) - F(τ_n)) / h of that curve.

    An angle that restarts with every turn is unwrapped first. A switching channel, and a column beyond the
    schema with missing values, takes the value of the nearest row.

    Parameters
    ----------
    columns
        Arrays (n,) by name, including `time_s` [s], which increases.
    sampling
        Meaning of a row: "mean" or "instant".

    Returns
    -------
    Columns of the same names and lengths, read-only; notes, none if the rows were uniform.

    References
    ----------
    [1] H. Akima, A new method of interpolation and smooth curve fitting based on local procedures,
    Journal of the ACM 17 (1970).
    """
    time = columns["time_s"]
    if is_uniform(time):
        return columns, ()
    rows = time.size
    steps = np.diff(time)
    edges = edges_of(time) if sampling == "mean" else time
    grid = np.linspace(edges[0], edges[-1], edges.size)
    nearest = np.searchsorted((time[1:] + time[:-1]) / 2, grid[:rows])
    uniform = {}
    for name, recorded in columns.items():
        values = continuous(recorded) if name == "angle_rad" else recorded
        if name == "time_s":
            uniform[name] = grid[:rows]
        elif name in HELD or not np.all(np.isfinite(values)):
            uniform[name] = values[nearest]
        elif sampling == "mean":
            integral = np.append(0.0, np.cumsum(values * np.diff(edges)))
            uniform[name] = np.diff(curve(edges, integral, grid)) / np.diff(grid)
        else:
            uniform[name] = curve(time, values, grid)
        uniform[name].setflags(write=False)
    interval = float(grid[-1] - grid[0]) / (grid.size - 1)
    relative = np.abs(steps / interval - 1)
    note = (
        f"time steps differ from {interval:.4g} s by {100 * np.sqrt(np.mean(relative**2)):.2g} % rms, by "
        f"{100 * relative.max():.2g} % at row {np.argmax(relative) + 2}; the rows were resampled to "
        f"{1 / interval:.4g} Hz"
    )
    return uniform, (note,)
