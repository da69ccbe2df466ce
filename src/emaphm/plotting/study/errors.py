"""Figure of each method's error in each case."""

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from emaphm.plotting.study.methods import error_label, floored, has_thesis, label_of, looks, method_legend
from emaphm.plotting.style import GUIDE, PAGE_WIDTH, log_axis, new_figure, style_axis
from emaphm.study.analysis.statistics import by_case
from emaphm.study.analysis.tables import MOST_CASES, methods_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_errors(runs: pl.DataFrame) -> "Figure":
    """Return the figure of each method's median error and quartiles by case, with the means of the thesis."""
    table = by_case(runs)
    cases = table["case"].unique(maintain_order=True).to_list()[:MOST_CASES]
    styles = looks(methods_of(runs))
    figure = new_figure(PAGE_WIDTH, 1.3 + len(cases) * (0.16 + 0.058 * len(styles)))
    axis = figure.subplots()
    row_of, offsets = {case: i for i, case in enumerate(cases)}, _offsets(styles)
    for row in table.filter(pl.col("case").is_in(cases)).iter_rows(named=True):
        place, style = row_of[row["case"]] + offsets[row["method"]], styles[row["method"]]
        ends = floored([row["lower_quartile"], row["upper_quartile"]])
        axis.plot(ends, [place, place], color=style.colour, linewidth=1.5, alpha=0.6)
        axis.plot(floored(row["median"]), place, style.marker, color=style.colour, markersize=4)
        if row["thesis"] is not None:
            axis.plot(floored(row["thesis"]), place, style.marker, **style.hollow(4.5))
    log_axis(axis, "x")
    axis.set_yticks(range(len(cases)), [label_of(case) for case in cases])
    axis.set_ylim(len(cases) - 0.5, -0.5)
    style_axis(axis, xlabel=error_label(table["lower_quartile"], "error [%]: median and quartiles"))
    axis.grid(visible=False, axis="y")
    for boundary in range(len(cases) - 1):
        axis.axhline(boundary + 0.5, color=GUIDE, linewidth=0.8)
    method_legend(figure, styles, thesis=has_thesis(table))
    return figure


def _offsets(methods: Collection[str]) -> dict[str, float]:
    """Return the offset of each method in a case's row of height 1."""
    places = (np.arange(len(methods)) + 0.5) / len(methods) - 0.5
    return dict(zip(methods, (0.84 * places).tolist(), strict=True))
