"""Figure of the fitness study: fitness over each fault's scan, its minimum and the true value."""

from typing import TYPE_CHECKING

import polars as pl

from emaphm.errors import MethodError, nearest
from emaphm.plotting.style import (
    BLUE,
    DARK,
    PAGE_WIDTH,
    RECORDED,
    VERMILION,
    Dashes,
    legend_above,
    new_figure,
    style_axis,
)
from emaphm.study.thesis.fitness_study import GRID, MODELS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {"torque": BLUE, "magnitude": VERMILION}
"""Colours by the form of equivalent current."""

LEVELS: dict[str, Dashes] = {"low": "-", "high": "--"}
"""Dashes by the size of the fault."""

TRUTH = RECORDED
"""Colour of the line at the true value."""


def draw_scans(study: pl.DataFrame, model: str = "averaged") -> "Figure":
    """Return the figure of the mean squared difference over the scans of a `fitness_study`, by fault.

    Each panel has the low and the high state with the torque and the magnitude current, a dot at the minimum
    and a vertical line at the true value.

    Raises
    ------
    MethodError
        The study does not have this model.
    """
    if model not in MODELS:
        raise MethodError(f"unknown model '{model}'{nearest(model, MODELS)}")
    rows_of_model = study.filter(
        pl.col("fitness") == "least_squares",
        pl.col("model") == model,
        pl.col("equivalent").is_in(list(COLOURS)),
        pl.col("level").is_in(list(LEVELS)),
    )
    figure = new_figure(PAGE_WIDTH, 7.5)
    axes = figure.subplots(3, 2, sharey=True)
    for axis, ((fault,), rows) in zip(
        axes.flat, rows_of_model.group_by("fault", maintain_order=True), strict=True
    ):
        _scans(axis, rows)
        style_axis(axis, str(fault))
    for axis in axes[-1]:
        axis.set_xlabel("normalised component, all others true")
    for axis in axes[:, 0]:
        axis.set_ylabel("mean squared difference [A²]")
    _legend(figure)
    return figure


def _scans(axis: "Axes", rows: pl.DataFrame) -> None:
    for row in rows.iter_rows(named=True):
        colour, dashes = COLOURS[row["equivalent"]], LEVELS[row["level"]]
        axis.axvline(row["truth"], color=TRUTH, linestyle=dashes, linewidth=1)
        axis.semilogy(GRID, row["scan"], color=colour, linestyle=dashes, linewidth=1.3)
        axis.plot(row["argmin"], row["least"], "o", color=colour, markersize=5)
    axis.set_xlim(-0.02, 1.02)


def _legend(figure: "Figure") -> None:
    from matplotlib.lines import Line2D

    lines = {
        f"{form} current, {level} fault": Line2D([], [], color=colour, linestyle=dashes)
        for form, colour in COLOURS.items()
        for level, dashes in LEVELS.items()
    }
    lines["minimum"] = Line2D([], [], color=DARK, marker="o", linestyle="", markersize=5)
    lines["true value"] = Line2D([], [], color=TRUTH, linewidth=1)
    legend_above(figure, list(lines.values()), list(lines))
