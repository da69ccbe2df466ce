"""How far each method has come, by number of evaluations, over all runs."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import ArrayLike

from emaphm.arrays import Array

POINTS = 60
"""Points of a curve, equally far apart on a logarithmic scale."""


def convergence(runs: pl.DataFrame, curve: str) -> dict[str, tuple[Array, Array]]:
    """Return evaluations, shape (n,), and the quartiles of `curve`, shape (3, n), by method.

    A run counts from its first population on, and keeps its last value where it ended before others. A
    method begins where every run has a value, and methods whose runs have no curve are left out.

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
        held = [y[np.searchsorted(x, grid, side="right") - 1] for x, y in zip(spent, reached, strict=True)]
        curves[str(method)] = grid, quartiles(held)
    return curves


def quartiles(values: ArrayLike) -> Array:
    """Return the quartiles over the first axis, shape (3, …); NaN where they fall between infinite values."""
    with np.errstate(invalid="ignore"):  # a fitness is infinite until a finite one is met: inf less inf
        return np.asarray(np.percentile(np.asarray(values, float), [25, 50, 75], axis=0))


def _grid(spent: Sequence[Array]) -> Array:
    first, last = max(x[0] for x in spent), max(x[-1] for x in spent)
    return np.unique(np.round(np.geomspace(first, max(first, last), POINTS)))
