"""Figure of the mean error over time and evaluations."""

from typing import TYPE_CHECKING

import polars as pl

from emaphm.plotting.study.methods import error_label, floored, has_thesis, looks, method_legend
from emaphm.plotting.style import PAGE_WIDTH, log_axis, new_figure, style_axis
from emaphm.study.analysis.statistics import by_method
from emaphm.study.analysis.tables import methods_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_costs(runs: pl.DataFrame) -> "Figure | None":
    """Return the figure of each method's mean error over time and evaluations; thesis values are hollow.

    There is one row per kind of case; None if no run is common to all methods.
    """
    table = by_method(runs)
    kinds = table["kind"].unique(maintain_order=True).to_list()
    if not kinds:
        return None
    styles = looks(methods_of(runs))
    figure = new_figure(PAGE_WIDTH, 1.1 + 2.5 * len(kinds))
    axes = figure.subplots(len(kinds), 2, squeeze=False, sharey="row", sharex="col")
    for (times, counts), kind in zip(axes, kinds, strict=True):
        of_kind = table.filter(pl.col("kind") == kind)
        for row in of_kind.iter_rows(named=True):
            style, error = styles[row["method"]], floored(row["mean"])
            times.plot(row["seconds"], error, style.marker, color=style.colour, markersize=6)
            counts.plot(row["evaluations"], error, style.marker, color=style.colour, markersize=6)
            if row["thesis"] is not None and row["thesis_seconds"] is not None:
                times.plot(row["thesis_seconds"], row["thesis"], style.marker, **style.hollow(6))
        style_axis(times, kind, "", error_label(of_kind["mean"], "mean error [%]"))
        style_axis(counts)
        for axis in (times, counts):
            log_axis(axis, "xy")
    axes[-1, 0].set_xlabel("wall time of one run [s]")
    axes[-1, 1].set_xlabel("evaluations of one run")
    method_legend(figure, styles, thesis=has_thesis(table))
    return figure
