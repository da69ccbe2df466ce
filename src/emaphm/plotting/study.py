"""Figures of a study: errors by case, convergence, error against cost, success, ranks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import polars as pl
from numpy.typing import ArrayLike

from emaphm.arrays import Array
from emaphm.study.analysis.convergence import convergence, quartiles
from emaphm.study.analysis.ranks import SIGNIFICANT, mean_ranks, pairs
from emaphm.study.analysis.statistics import LIMITS_PERCENT, by_case, by_method, prepared
from emaphm.study.analysis.tables import MOST_CASES, methods_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#8c510a")
"""Told apart by the colour-blind (after Okabe and Ito 2008)."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "h")
"""As many as share no divisor with the colours: 88 methods differ in one or the other."""

SHADES = ("#a6cee9", "#4a9bd1", "#084a7d")
"""Of the success rates' bars, the widest limit first; lightness tells them apart in grey print too."""

DASHES: tuple[Literal["-", "--", ":"], ...] = ("-", "--", ":")

WIDTH = 8.0
"""Width of a figure [in]."""

FLOOR = 1e-3
"""Least error [%] that is drawn: a logarithmic axis has no zero, and less error is of no use to anyone."""

TICKS = {0.7: range(1, 10), 3.0: (1, 2, 5)}
"""What is marked in each decade of a logarithmic axis that spans fewer decades than the key; else 1 alone."""

WIDE = 8.0
"""Decades from which on the marks are written as powers of ten."""

LONGEST_NAME = 24

MOST_COLUMNS = 5
"""Names side by side in a legend."""

LEGEND: dict[str, Any] = {
    "frameon": False,
    "fontsize": 8,
    "handlelength": 1.8,
    "handletextpad": 0.5,
    "columnspacing": 1.2,
}


@dataclass(frozen=True)
class Look:
    """How one method is drawn in every figure."""

    colour: str
    marker: str
    dashes: Literal["-", "--", ":"]


def looks(methods: Sequence[str]) -> dict[str, Look]:
    """Return a look for each method; it follows from the place in the list alone."""
    return {
        method: Look(
            COLOURS[i % len(COLOURS)],
            MARKERS[i % len(MARKERS)],
            DASHES[i // len(COLOURS) % len(DASHES)],
        )
        for i, method in enumerate(methods)
    }


def draw_errors(runs: pl.DataFrame) -> "Figure":
    """Draw each method's median error and quartiles in each case of one variant, and the thesis's means."""
    from matplotlib.figure import Figure

    table = by_case(runs)
    cases = table["case"].unique(maintain_order=True).to_list()[:MOST_CASES]
    styles = looks(methods_of(runs))
    figure = Figure(figsize=(WIDTH, 1.3 + len(cases) * (0.16 + 0.058 * len(styles))), layout="constrained")
    axis = figure.subplots()
    row_of, offsets = {case: i for i, case in enumerate(cases)}, _offsets(styles)
    for row in table.filter(pl.col("case").is_in(cases)).iter_rows(named=True):
        place, style = row_of[row["case"]] + offsets[row["method"]], styles[row["method"]]
        ends = _floored([row["lower_quartile"], row["upper_quartile"]])
        axis.plot(ends, [place, place], color=style.colour, linewidth=1.5, alpha=0.6)
        axis.plot(_floored(row["median"]), place, style.marker, color=style.colour, markersize=4)
        if row["thesis"] is not None:
            axis.plot(_floored(row["thesis"]), place, style.marker, **_hollow(style, 4.5))
    _log(axis, "x")
    axis.set_yticks(range(len(cases)), [_plain(case) for case in cases])
    axis.set_ylim(len(cases) - 0.5, -0.5)
    _style(axis, "", _error_label(table["lower_quartile"], "error [%]: median and quartiles"), "")
    axis.grid(visible=False, axis="y")
    for boundary in range(len(cases) - 1):
        axis.axhline(boundary + 0.5, color="0.85", linewidth=0.8)
    _legend(figure, styles, thesis=_has_thesis(table))
    return figure


def _offsets(methods: Mapping[str, Look]) -> dict[str, float]:
    """Return where in a case's row, of height 1, each method stands."""
    places = (np.arange(len(methods)) + 0.5) / len(methods) - 0.5
    return dict(zip(methods, (0.84 * places).tolist(), strict=True))


def draw_convergence(runs: pl.DataFrame, fitness_unit: str) -> "Figure":
    """Draw the best error and fitness so far against evaluations: median and quartiles of a variant's runs.

    A method without populations is a marker at its evaluations and its final median. One column for each kind
    of case.

    Parameters
    ----------
    fitness_unit
        Unit of the variant's fitness, e.g. ``"A²"``.
    """
    from matplotlib.figure import Figure

    rows = prepared(runs)
    kinds = rows["kind"].unique(maintain_order=True).to_list()
    styles = looks(methods_of(runs))
    figure = Figure(figsize=(WIDTH, 5.6), layout="constrained")
    axes = figure.subplots(2, len(kinds), squeeze=False, sharex=True, sharey="row")
    for column, kind in enumerate(kinds):
        of_kind = rows.filter(pl.col("kind") == kind)
        above, below = axes[:, column]
        _converge(above, of_kind, "error_percent", styles, FLOOR)
        least = _least_positive(rows["fitness_value"])
        _converge(below, of_kind, "fitness", styles, least)
        first = column == 0
        label = _error_label(rows["error_percent"], "error of the best so far [%]")
        _style(above, kind, "", label if first else "")
        _style(below, "", "evaluations", f"best fitness so far [{fitness_unit}]" if first else "")
    _legend(figure, styles)
    return figure


def _converge(axis: "Axes", runs: pl.DataFrame, what: str, styles: Mapping[str, Look], floor: float) -> None:
    curves = convergence(runs, f"curve_{what}")
    for method, (evaluations, spread) in curves.items():
        style = styles[method]
        lower, median, upper = _drawable(spread, floor)
        axis.fill_between(evaluations, lower, upper, color=style.colour, alpha=0.12, linewidth=0)
        axis.plot(evaluations, median, style.dashes, color=style.colour, linewidth=1.3)
        axis.plot(evaluations[-1], median[-1], style.marker, color=style.colour, markersize=5)
    final = "error_percent" if what == "error_percent" else "fitness_value"
    for (name,), group in runs.group_by("method", maintain_order=True):
        method = str(name)
        if method in curves:
            continue
        lower, median, upper = _drawable(quartiles(group[final].to_numpy()), floor)
        style, at = styles[method], float(group["evaluations"].to_numpy().mean())
        axis.plot([at, at], [lower, upper], color=style.colour, linewidth=1.5, alpha=0.6)
        axis.plot(at, median, style.marker, color=style.colour, markersize=6)
    _log(axis, "xy")


def _drawable(values: Array, floor: float) -> Array:
    """Return `values`, at least `floor`; what is infinite becomes a gap."""
    return np.where(np.isfinite(values), np.maximum(values, floor), np.nan)


def draw_costs(runs: pl.DataFrame) -> "Figure | None":
    """Draw each method's mean error against its time and its evaluations, the thesis's as hollow markers.

    One row for each kind of case; None where no case has been run by every method.
    """
    from matplotlib.figure import Figure

    table = by_method(runs)
    kinds = table["kind"].unique(maintain_order=True).to_list()
    if not kinds:
        return None
    styles = looks(methods_of(runs))
    figure = Figure(figsize=(WIDTH, 1.1 + 2.5 * len(kinds)), layout="constrained")
    axes = figure.subplots(len(kinds), 2, squeeze=False, sharey="row", sharex="col")
    for (times, counts), kind in zip(axes, kinds, strict=True):
        of_kind = table.filter(pl.col("kind") == kind)
        for row in of_kind.iter_rows(named=True):
            style, error = styles[row["method"]], _floored(row["mean"])
            times.plot(row["seconds"], error, style.marker, color=style.colour, markersize=6)
            counts.plot(row["evaluations"], error, style.marker, color=style.colour, markersize=6)
            if row["thesis"] is not None and row["thesis_seconds"] is not None:
                times.plot(row["thesis_seconds"], row["thesis"], style.marker, **_hollow(style, 6))
        _style(times, kind, "", _error_label(of_kind["mean"], "mean error [%]"))
        _style(counts, "", "", "")
        for axis in (times, counts):
            _log(axis, "xy")
    axes[-1, 0].set_xlabel("wall time of one run [s]", fontsize=8)
    axes[-1, 1].set_xlabel("evaluations of one run", fontsize=8)
    _legend(figure, styles, thesis=_has_thesis(table))
    return figure


def draw_success(runs: pl.DataFrame) -> "Figure | None":
    """Draw the share of runs within 1, 2 and 5 % of error, by method and kind; None as in `draw_costs`."""
    from matplotlib.figure import Figure

    table = by_method(runs)
    kinds = table["kind"].unique(maintain_order=True).to_list()
    if not kinds:
        return None
    methods = methods_of(runs)
    figure = Figure(figsize=(WIDTH, 1.1 + 0.26 * len(methods)), layout="constrained")
    axes = figure.subplots(1, len(kinds), squeeze=False, sharey=True)[0]
    for axis, kind in zip(axes, kinds, strict=True):
        of_kind = table.filter(pl.col("kind") == kind)
        rows = [methods.index(method) for method in of_kind["method"]]
        # The widest first: the narrower limit's bar is never longer and stands before it.
        for limit, shade in zip(reversed(LIMITS_PERCENT), SHADES, strict=True):
            share = 100 * of_kind[f"within_{limit}"].to_numpy()
            axis.barh(rows, share, color=shade, height=0.7, label=f"error at most {limit} %")
        axis.set_yticks(range(len(methods)), [_plain(method) for method in methods])
        axis.set(xlim=(0, 100), ylim=(len(methods) - 0.5, -0.5))
        _style(axis, kind, "runs [%]", "")
        axis.grid(visible=False, axis="y")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], loc="outside upper center", ncols=3, **LEGEND)
    return figure


def draw_ranks(runs: pl.DataFrame) -> "Figure | None":
    """Draw each method's mean rank, best first; a bar beside joins methods that no test tells apart.

    None where no block is complete.
    """
    from matplotlib.figure import Figure

    table = mean_ranks(runs).drop_nulls().sort("mean_rank", maintain_order=True)
    if table.is_empty():
        return None
    styles, methods = looks(methods_of(runs)), table["method"].to_list()
    figure = Figure(figsize=(WIDTH, 0.8 + 0.26 * len(methods)), layout="constrained")
    axis = figure.subplots()
    for row, (method, rank) in enumerate(zip(methods, table["mean_rank"], strict=True)):
        style = styles[method]
        axis.plot([1, rank], [row, row], color=style.colour, linewidth=1.5, alpha=0.6)
        axis.plot(rank, row, style.marker, color=style.colour, markersize=6)
        axis.annotate(f"{rank:.2f}", (rank, row), (7, 0), textcoords="offset points", va="center", fontsize=8)
    for i, (first, last) in enumerate(_alike(methods, pairs(runs))):
        place = len(methods) + 0.7 + 0.15 * i
        axis.plot([place, place], [first - 0.25, last + 0.25], color="black", linewidth=2.5)
    axis.set_yticks(range(len(methods)), [_plain(method) for method in methods])
    axis.set_xticks(range(1, len(methods) + 1))
    axis.set_ylim(len(methods) - 0.5, -0.5)
    _style(axis, "", f"mean rank over {table['blocks'][0]} runs of the same case and seed (1 is best)", "")
    axis.grid(visible=False, axis="y")
    return figure


def _alike(methods: Sequence[str], tests: pl.DataFrame) -> list[tuple[int, int]]:
    """Return first and last place of each longest stretch of `methods` in which no pair differs.

    Empty where nothing was tested.
    """
    if tests["p"].null_count() == tests.height:
        return []
    differ = {
        frozenset((row["method"], row["other"]))
        for row in tests.filter(pl.col("p_holm") <= SIGNIFICANT).iter_rows(named=True)
    }
    stretches: list[tuple[int, int]] = []
    for first in range(len(methods)):
        last = first
        while last + 1 < len(methods) and not any(
            frozenset((methods[last + 1], method)) in differ for method in methods[first : last + 1]
        ):
            last += 1
        if last > first and not (stretches and stretches[-1][1] >= last):
            stretches.append((first, last))
    return stretches


def _floored(values: ArrayLike) -> Array:
    return np.asarray(np.maximum(np.asarray(values, float), FLOOR))


def _least_positive(values: pl.Series) -> float:
    """Return where a fitness of zero, which a logarithmic axis lacks, is drawn: below all others."""
    positive = values.filter((values > 0) & values.is_finite())
    return float(positive.to_numpy().min()) / 10 if len(positive) else 1.0


def _error_label(drawn: pl.Series, label: str) -> str:
    """Return `label`, and how much is drawn as the least where that is more than it is."""
    return f"{label}, {FLOOR:g} or less at {FLOOR:g}" if (drawn < FLOOR).any() else label


def _has_thesis(table: pl.DataFrame) -> bool:
    return table["thesis"].null_count() < table.height


def _plain(name: str) -> str:
    """Return a name that fits beside an axis and is no formula."""
    name = " ".join(name.split())
    short = name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1]}…"
    return short.replace("$", r"\$")


def _hollow(style: Look, size: float) -> dict[str, Any]:
    return {"color": style.colour, "markersize": size, "markerfacecolor": "white", "markeredgewidth": 1.2}


def _style(axis: "Axes", title: str, xlabel: str, ylabel: str) -> None:
    axis.set_title(title, loc="left", fontsize=9)
    axis.set_xlabel(xlabel, fontsize=8)
    axis.set_ylabel(ylabel, fontsize=8)
    axis.tick_params(which="both", labelsize=8)
    axis.grid(alpha=0.3)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)


def _log(axis: "Axes", directions: str) -> None:
    """Make what is drawn logarithmic, with plain numbers at the ticks where they are few."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for direction in directions:
        axis.set(**{f"{direction}scale": "log"})
        along = axis.xaxis if direction == "x" else axis.yaxis
        low, high = along.get_view_interval()
        decades = np.log10(high / low)
        marked = next((marks for span, marks in TICKS.items() if decades < span), (1,))
        along.set_major_locator(LogLocator(subs=tuple(marked)))
        along.set_minor_formatter(NullFormatter())
        if decades < WIDE:
            along.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.9g}"))


def _legend(figure: "Figure", styles: Mapping[str, Look], *, thesis: bool = False) -> None:
    """Name the methods above the figure, and the hollow markers if any are there."""
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=look.colour, marker=look.marker, linestyle=look.dashes, markersize=5)
        for look in styles.values()
    ]
    names = [_plain(method) for method in styles]
    if thesis:
        handles.append(
            Line2D([], [], color="0.3", marker="o", linestyle="", markersize=5, markerfacecolor="white")
        )
        names.append("printed in the thesis")
    columns = ceil(len(names) / ceil(len(names) / MOST_COLUMNS))
    legend = figure.legend(handles, ["-"] * len(names), loc="outside upper center", ncols=columns, **LEGEND)
    # Set afterwards: a legend leaves out a name that begins with an underscore.
    for text, name in zip(legend.get_texts(), names, strict=True):
        text.set_text(name)
