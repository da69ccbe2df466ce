"""Figure of the best error and fitness so far over evaluations."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from emaphm.arrays import Array
from emaphm.plotting.study.methods import FLOOR, Look, error_label, looks, method_legend
from emaphm.plotting.style import PAGE_WIDTH, log_axis, new_figure, style_axis
from emaphm.study.analysis.convergence import convergence, quartiles
from emaphm.study.analysis.statistics import comparable, prepared
from emaphm.study.analysis.tables import methods_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_convergence(runs: pl.DataFrame, fitness_unit: str) -> "Figure | None":
    """Return the figure of the best error and fitness over evaluations: median and quartiles of the runs.

    A method without populations has a marker at its evaluations and its final median. There is one column per
    kind of case, with the `comparable` runs; None without any.

    Parameters
    ----------
    fitness_unit
        Unit of the variant's fitness, e.g. ``"A²"``.
    """
    rows = comparable(prepared(runs))
    if rows.is_empty():
        return None
    kinds = rows["kind"].unique(maintain_order=True).to_list()
    styles = looks(methods_of(runs))
    figure = new_figure(PAGE_WIDTH, 5.6)
    axes = figure.subplots(2, len(kinds), squeeze=False, sharex=True, sharey="row")
    for column, kind in enumerate(kinds):
        of_kind = rows.filter(pl.col("kind") == kind)
        above, below = axes[:, column]
        _converge(above, of_kind, "error_percent", styles, FLOOR)
        least = _least_positive(rows["fitness_value"])
        _converge(below, of_kind, "fitness", styles, least)
        first = column == 0
        label = error_label(rows["error_percent"], "error of the best so far [%]")
        style_axis(above, kind, "", label if first else "")
        style_axis(below, "", "evaluations", f"best fitness so far [{fitness_unit}]" if first else "")
    method_legend(figure, styles)
    return figure


def _converge(
    axis: "Axes", runs: pl.DataFrame, quantity: str, styles: Mapping[str, Look], floor: float
) -> None:
    """Draw the curves of `quantity` ("error_percent" or "fitness"), and markers of methods without curves."""
    curves = convergence(runs, f"curve_{quantity}")
    for method, (evaluations, spread) in curves.items():
        style = styles[method]
        lower, median, upper = _drawable(spread, floor)
        axis.fill_between(evaluations, lower, upper, color=style.colour, alpha=0.12, linewidth=0)
        axis.plot(evaluations, median, style.dashes, color=style.colour, linewidth=1.3)
        axis.plot(evaluations[-1], median[-1], style.marker, color=style.colour, markersize=5)
    final = "error_percent" if quantity == "error_percent" else "fitness_value"
    for (name,), group in runs.group_by("method", maintain_order=True):
        method = str(name)
        if method in curves:
            continue
        lower, median, upper = _drawable(quartiles(group[final].to_numpy()), floor)
        style, evaluations_mean = styles[method], float(group["evaluations"].to_numpy().mean())
        axis.plot(
            [evaluations_mean, evaluations_mean], [lower, upper], color=style.colour, linewidth=1.5, alpha=0.6
        )
        axis.plot(evaluations_mean, median, style.marker, color=style.colour, markersize=6)
    log_axis(axis, "xy")


def _drawable(values: Array, floor: float) -> Array:
    """Return `values`, at least `floor`; infinite values become gaps."""
    return np.where(np.isfinite(values), np.maximum(values, floor), np.nan)


def _least_positive(values: pl.Series) -> float:
    """Return the value at which a fitness of zero is drawn on a logarithmic axis, below all others."""
    positive = values.filter((values > 0) & values.is_finite())
    return float(positive.to_numpy().min()) / 10 if len(positive) else 1.0
