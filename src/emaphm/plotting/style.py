"""Common style of all figures: palette, sizes, axes, legends and text.

A drawing function uses `new_figure`, the colours below, and `style_axis` for each axis. Figures are made
without `pyplot`: they need no window and do not change the user's settings.
"""

from collections.abc import Sequence
from math import ceil
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE, VERMILION, GREEN, PURPLE = "#0072b2", "#d55e00", "#009e73", "#cc79a7"
ORANGE, SKY_BLUE, BLACK, BROWN = "#e69f00", "#56b4e9", "#000000", "#8c510a"

SERIES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY_BLUE, BLACK, BROWN)
"""Colours of curves in order: Okabe and Ito (2008), for colour-blind readers.

Their yellow is too light for a line on white and is replaced by brown.
"""

RECORDED, MODEL, RESIDUAL = "0.6", VERMILION, BLUE
"""Colours of recorded signal, model and residual; their lightness differs in grey print."""

FAINT = "0.55"
"""Colour of secondary or unknown elements."""

DARK = "0.3"
"""Colour of a legend's marker that represents all colours."""

GUIDE = "0.85"
"""Colour of a separating line."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "h")
"""Markers; their number is coprime to that of `SERIES`, so that 88 pairs of colour and marker differ."""

Dashes = Literal["-", "--", ":"]

DASHES: tuple[Dashes, ...] = ("-", "--", ":")

PAGE_WIDTH = 8.0
"""Width [in] of a figure as wide as a page."""

PHONE_WIDTH = 5.6
"""Width [in] of a figure with legible text on a phone."""

PADDING = 0.07
"""Padding [in] around a figure and between its axes."""

SMALL_TEXT, TEXT, TITLE, FIGURE_TITLE = 7, 8, 9, 10
"""Sizes of text [pt]: ticks of small panels; ticks, labels and legends; title of an axis; of a figure."""

LEGEND: dict[str, Any] = {
    "frameon": False,
    "fontsize": TEXT,
    "handlelength": 1.8,
    "handletextpad": 0.5,
    "columnspacing": 1.2,
}

MOST_COLUMNS = 5
"""Largest number of columns in a legend above a figure."""

LETTER = 0.65
"""Width of a character relative to the text size; 0.6 is the mean in matplotlib's font."""

TICKS = {0.7: range(1, 10), 3.0: (1, 2, 5)}
"""Multiples with ticks in a decade of a logarithmic axis that spans fewer decades than the key; default 1."""

MOST_INTERVALS = ((7, 3), (6, 5))
"""Least length of the longest number [characters], and the number of intervals between ticks from it on."""

WIDE = 8.0
"""Decades from which on ticks are written as powers of ten."""


def new_figure(width: float, height: float) -> "Figure":
    """Return an empty figure of that size [in] with a constrained layout for labels and legends."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    return Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(w_pad=PADDING, h_pad=PADDING))


def style_axis(axis: "Axes", title: str = "", xlabel: str = "", ylabel: str = "") -> None:
    """Give `axis` its title, labels, grid and text sizes."""
    axis.set_title(title, loc="left", fontsize=TITLE)
    axis.set_xlabel(xlabel, fontsize=TEXT)
    axis.set_ylabel(ylabel, fontsize=TEXT)
    axis.tick_params(which="both", labelsize=TEXT)
    axis.grid(alpha=0.3)
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)


def log_axis(axis: "Axes", directions: str) -> None:
    """Make the `directions` ("x", "y" or "xy") of an axis logarithmic, with few plain numbers.

    Call it after the last curve, because the ticks depend on the span of the axis.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for direction in directions:
        axis.set(**{f"{direction}scale": "log"})
        scale_axis = axis.xaxis if direction == "x" else axis.yaxis
        low, high = scale_axis.get_view_interval()
        decades = np.log10(high / low)
        multiples = next((marks for span, marks in TICKS.items() if decades < span), (1,))
        scale_axis.set_major_locator(LogLocator(subs=tuple(multiples)))
        scale_axis.set_minor_formatter(NullFormatter())
        if decades < WIDE:
            scale_axis.set_major_formatter(FuncFormatter(_number_text))


def log_axis_from_zero(axis: "Axes", start: float) -> None:
    """Make the vertical axis logarithmic above `start` and linear below, down to 0, with plain numbers.

    Call it after the last curve.
    """
    from matplotlib.ticker import FuncFormatter, NullFormatter, SymmetricalLogLocator

    axis.set_yscale("symlog", linthresh=start, linscale=0.5)
    axis.set_ylim(bottom=0)
    axis.yaxis.set_minor_locator(SymmetricalLogLocator(base=10, linthresh=start, subs=list(range(2, 10))))
    axis.yaxis.set_minor_formatter(NullFormatter())
    axis.yaxis.set_major_formatter(FuncFormatter(_number_text))


def _number_text(value: float, _: object = None) -> str:
    """Return the text of a number on an axis."""
    return f"{value:,.9g}"


def plain_numbers(axis: "Axes") -> None:
    """Write the numbers on the horizontal axis without exponents, with fewer ticks if they are long.

    Call it after the last curve, because the ticks depend on the span of the axis.
    """
    from matplotlib.ticker import FuncFormatter

    axis.xaxis.set_major_formatter(FuncFormatter(_number_text))
    longest = max(len(_number_text(round(end))) for end in axis.get_xlim())
    intervals = next((count for length, count in MOST_INTERVALS if longest >= length), None)
    if intervals is not None:
        axis.locator_params(axis="x", nbins=intervals)


def legend_beside_title(axis: "Axes", columns: int = 2) -> None:
    """Put the legend to the right of the axis's title, outside the plot."""
    handles, _ = axis.get_legend_handles_labels()
    axis.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1, 1), ncols=columns, borderaxespad=0.2, **LEGEND
    )


def legend_above(figure: "Figure", handles: Sequence["Artist"], names: Sequence[str]) -> None:
    """Put one legend above all axes, in as few rows as its names and `MOST_COLUMNS` allow."""
    columns = _columns(names, figure.get_figwidth())
    legend = figure.legend(handles, ["-"] * len(names), loc="outside upper center", ncols=columns, **LEGEND)
    # Set afterwards, because a legend omits names that begin with an underscore.
    for text, name in zip(legend.get_texts(), names, strict=True):
        text.set_text(name)


def _columns(names: Sequence[str], width: float) -> int:
    """Return the largest number of columns of a legend of `names` in a figure of that width [in]."""
    largest = min(len(names), MOST_COLUMNS)
    balanced = [ceil(len(names) / ceil(len(names) / columns)) for columns in range(largest, 0, -1)]
    gaps = LEGEND["handlelength"] + LEGEND["handletextpad"] + LEGEND["columnspacing"]
    for columns in balanced:
        longest = [max(map(len, column)) for column in np.array_split(np.array(names), columns)]
        if sum(gaps + LETTER * length for length in longest) * TEXT / 72 <= width:
            return columns
    return 1


def figure_title(figure: "Figure", text: str) -> None:
    """Write `text` above the figure without parsing formulas, as it may contain a file name."""
    figure.suptitle(readable(text), fontsize=FIGURE_TITLE, parse_math=False)


def shortened(name: str, longest: int) -> str:
    """Return `name` on one line, cut with an ellipsis if it has more than `longest` characters."""
    name = " ".join(readable(name).split())
    return name if len(name) <= longest else f"{name[: longest - 1]}…"


def no_formula(text: str) -> str:
    """Return `text` with escaped dollar signs, so that matplotlib does not parse a formula."""
    return readable(text).replace("$", r"\$")


def readable(text: str) -> str:
    """Return `text` with question marks for invalid characters: file names may have any bytes."""
    return text.encode(errors="replace").decode()
