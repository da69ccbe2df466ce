"""Convergence of each method: quartiles over all runs, by number of evaluations."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import ArrayLike

from emaphm.arrays import Array

POINTS = 60
"""Number of points of a curve, equally spaced on a logarithmic scale."""


def convergence(runs: pl.DataFrame, curve: str) -> dict[str, tuple[Array, Array]]:
    """Return evaluations (n,) and the quartiles of `curve` (3, n) by method.

    A run counts from its first population on, and keeps its last value if it ended before the other runs. The
    curve of a method begins where every run has a value; methods without curves are left out.

    Parameters
    ----------
    runs
        Runs of one variant.
    curve
        ``"curve_error_percent"`` or ``"curve_fitness"``.
    """
    curves: dict[str, tuple[Array, Array]] = {}
    for (method,), group in runs.sort("index").group_by("method", maintain_order=True):
        known = group.filter(pl.col("curve_evaluations").list.len() > 0)
        if known.is_empty():
            continue
        spent = [np.asarray(values, float) for values in known["curve_evaluations"].to_list()]
        reached = [np.asarray(values, float) for values in known[curve].to_list()]
        grid = _grid(spent)
        on_grid = [y[np.searchsorted(x, grid, side="right") - 1] for x, y in zip(spent, reached, strict=True)]
        curves[str(method)] = grid, quartiles(on_grid)
    return curves


def quartiles(values: ArrayLike) -> Array:
    """Return the quartiles over the first axis, shape (3, …); NaN where they lie between infinite values."""
    with np.errstate(invalid="ignore"):  # a fitness is infinite until the first finite value: inf - inf
        return np.asarray(np.percentile(np.asarray(values, float), [25, 50, 75], axis=0))


def _grid(spent: Sequence[Array]) -> Array:
    first, last = max(x[0] for x in spent), max(x[-1] for x in spent)
    return np.unique(np.round(np.geomspace(first, max(first, last), POINTS)))
