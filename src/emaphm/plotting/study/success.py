"""Figure of the success rates of the methods."""

from typing import TYPE_CHECKING

import polars as pl

from emaphm.plotting.study.methods import label_of
from emaphm.plotting.style import LEGEND, PAGE_WIDTH, new_figure, style_axis
from emaphm.study.analysis.statistics import LIMITS_PERCENT, by_method
from emaphm.study.analysis.tables import methods_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHADES = ("#a6cee9", "#4a9bd1", "#084a7d")
"""Colours of the bars, widest limit first: one hue, with lightness as the order also in grey print."""


def draw_success(runs: pl.DataFrame) -> "Figure | None":
    """Return the figure of the shares of runs with an error within 1, 2 and 5 %, by method and kind of case.

    It is None if no run is common to all methods.
    """
    table = by_method(runs)
    kinds = table["kind"].unique(maintain_order=True).to_list()
    if not kinds:
        return None
    methods = methods_of(runs)
    figure = new_figure(PAGE_WIDTH, 1.1 + 0.26 * len(methods))
    axes = figure.subplots(1, len(kinds), squeeze=False, sharey=True)[0]
    for axis, kind in zip(axes, kinds, strict=True):
        of_kind = table.filter(pl.col("kind") == kind)
        rows = [methods.index(method) for method in of_kind["method"]]
        # Widest limit first: the bar of a narrower limit is not longer, and is drawn in front.
        for limit, shade in zip(reversed(LIMITS_PERCENT), SHADES, strict=True):
            share = 100 * of_kind[f"within_{limit}"].to_numpy()
            axis.barh(rows, share, color=shade, height=0.7, label=f"error at most {limit} %")
        axis.set_yticks(range(len(methods)), [label_of(method) for method in methods])
        axis.set(xlim=(0, 100), ylim=(len(methods) - 0.5, -0.5))
        style_axis(axis, kind, "runs [%]", "")
        axis.grid(visible=False, axis="y")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], loc="outside upper center", ncols=3, **LEGEND)
    return figure
