"""Figure of the mean rank of each method, and of groups without a significant difference."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import polars as pl

from emaphm.plotting.study.methods import label_of, looks
from emaphm.plotting.style import BLACK, PAGE_WIDTH, TEXT, new_figure, style_axis
from emaphm.study.analysis.ranks import SIGNIFICANT, mean_ranks, pairs
from emaphm.study.analysis.tables import methods_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_ranks(runs: pl.DataFrame) -> "Figure | None":
    """Return the figure of the methods' mean ranks, best first; bars join methods without a difference.

    It is None if no block is complete.
    """
    table = mean_ranks(runs).drop_nulls().sort("mean_rank", maintain_order=True)
    if table.is_empty():
        return None
    styles, methods = looks(methods_of(runs)), table["method"].to_list()
    figure = new_figure(PAGE_WIDTH, 0.8 + 0.26 * len(methods))
    axis = figure.subplots()
    for row, (method, rank) in enumerate(zip(methods, table["mean_rank"], strict=True)):
        style = styles[method]
        axis.plot([1, rank], [row, row], color=style.colour, linewidth=1.5, alpha=0.6)
        axis.plot(rank, row, style.marker, color=style.colour, markersize=6)
        axis.annotate(
            f"{rank:.2f}", (rank, row), (7, 0), textcoords="offset points", va="center", fontsize=TEXT
        )
    for i, (first, last) in enumerate(indistinct_ranges(methods, pairs(runs))):
        place = len(methods) + 0.7 + 0.15 * i
        axis.plot([place, place], [first - 0.25, last + 0.25], color=BLACK, linewidth=2.5)
    axis.set_yticks(range(len(methods)), [label_of(method) for method in methods])
    axis.set_xticks(range(1, len(methods) + 1))
    axis.set_ylim(len(methods) - 0.5, -0.5)
    style_axis(axis, xlabel=f"mean rank over {table['blocks'][0]} runs of the same case and seed (1 is best)")
    axis.grid(visible=False, axis="y")
    return figure


def indistinct_ranges(methods: Sequence[str], tests: pl.DataFrame) -> list[tuple[int, int]]:
    """Return first and last index of the longest ranges of `methods` without a significant difference.

    The list is empty without tests.
    """
    if tests["p"].null_count() == tests.height:
        return []
    differ = {
        frozenset((row["method"], row["other"]))
        for row in tests.filter((pl.col("p_holm") <= SIGNIFICANT) | pl.col("p_holm").is_null()).iter_rows(
            named=True
        )
    }
    ranges: list[tuple[int, int]] = []
    for first in range(len(methods)):
        last = first
        while last + 1 < len(methods) and not any(
            frozenset((methods[last + 1], method)) in differ for method in methods[first : last + 1]
        ):
            last += 1
        if last > first and not (ranges and ranges[-1][1] >= last):
            ranges.append((first, last))
    return ranges
