"""One style for all figures: palette, sizes, axes, legends and text.

A drawer needs `new_figure`, draws its lines in the colours below, and calls `style_axis` for each axis.
Figures are made without `pyplot`: they need no window and change none of the user's settings.
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
"""Colours of curves side by side, in order: Okabe and Ito (2008), made for colour-blind readers.

Their yellow is too light for a line on white; brown replaces it.
"""

RECORDED, MODEL, RESIDUAL = "0.6", VERMILION, BLUE
"""Colours of a recorded signal, of the model's and of their difference; lightness differs in grey print."""

FAINT = "0.55"
"""Colour of what is secondary or unknown."""

DARK = "0.3"
"""Colour of a legend's marker that stands for all colours."""

GUIDE = "0.85"
"""Colour of a line that separates."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "h")
"""Their number shares no divisor with that of `SERIES`: 88 pairs of colour and marker all differ."""

Dashes = Literal["-", "--", ":"]

DASHES: tuple[Dashes, ...] = ("-", "--", ":")

PAGE_WIDTH = 8.0
"""Width [in] of a figure as wide as a page."""

PHONE_WIDTH = 5.6
"""Width [in] of a figure whose text is still legible on a telephone."""

PADDING = 0.07
"""Room [in] around a figure and between its axes."""

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
"""Names side by side in a legend above a figure."""

LETTER = 0.65
"""Width of a letter as a share of the size of its text; 0.6 is the mean in matplotlib's font."""

TICKS = {0.7: range(1, 10), 3.0: (1, 2, 5)}
"""Marked multiples in each decade of a logarithmic axis that spans fewer decades than the key; else 1."""

SHORT_NUMBER, FEW_NUMBERS = 6, 3
"""Letters of a number up to which as many stand along an axis as else, and intervals between longer ones."""

WIDE = 8.0
"""Decades from which on ticks are written as powers of ten."""


def new_figure(width: float, height: float) -> "Figure":
    """Return an empty figure of that size [in], whose layout leaves room for labels and legends."""
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
    """Make the `directions` ("x", "y" or "xy") of what is drawn logarithmic, with few plain numbers.

    To be called after the last curve: the marks follow from the span of the axis.
    """
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
            along.set_major_formatter(FuncFormatter(_in_full))


def log_axis_from_zero(axis: "Axes", start: float) -> None:
    """Make the vertical axis logarithmic above `start` and even below, down to 0, with plain numbers.

    To be called after the last curve.
    """
    from matplotlib.ticker import FuncFormatter, NullFormatter, SymmetricalLogLocator

    axis.set_yscale("symlog", linthresh=start, linscale=0.5)
    axis.set_ylim(bottom=0)
    axis.yaxis.set_minor_locator(SymmetricalLogLocator(base=10, linthresh=start, subs=list(range(2, 10))))
    axis.yaxis.set_minor_formatter(NullFormatter())
    axis.yaxis.set_major_formatter(FuncFormatter(_in_full))


def _in_full(value: float, _: object = None) -> str:
    """Return the text of a number along an axis."""
    return f"{value:,.9g}"


def plain_numbers(axis: "Axes") -> None:
    """Write the numbers along the horizontal axis in full, fewer of them where they are long.

    To be called after the last curve: the marks follow from the span of the axis.
    """
    from matplotlib.ticker import FuncFormatter

    axis.xaxis.set_major_formatter(FuncFormatter(_in_full))
    if max(len(_in_full(round(end))) for end in axis.get_xlim()) > SHORT_NUMBER:
        axis.locator_params(axis="x", nbins=FEW_NUMBERS)


def legend_beside_title(axis: "Axes", columns: int = 2) -> None:
    """Put the legend at the right of the axis's title, where it hides nothing."""
    handles, _ = axis.get_legend_handles_labels()
    axis.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1, 1), ncols=columns, borderaxespad=0.2, **LEGEND
    )


def legend_above(figure: "Figure", handles: Sequence["Artist"], names: Sequence[str]) -> None:
    """Put one legend above all axes, in as few rows as its names and `MOST_COLUMNS` allow."""
    columns = _columns(names, figure.get_figwidth())
    legend = figure.legend(handles, ["-"] * len(names), loc="outside upper center", ncols=columns, **LEGEND)
    # Set afterwards: a legend leaves out a name that begins with an underscore.
    for text, name in zip(legend.get_texts(), names, strict=True):
        text.set_text(name)


def _columns(names: Sequence[str], width: float) -> int:
    """Return the most columns of a legend of `names` that fit into a figure of that width [in]."""
    most = min(len(names), MOST_COLUMNS)
    balanced = [ceil(len(names) / ceil(len(names) / columns)) for columns in range(most, 0, -1)]
    gaps = LEGEND["handlelength"] + LEGEND["handletextpad"] + LEGEND["columnspacing"]
    for columns in balanced:
        longest = [max(map(len, column)) for column in np.array_split(np.array(names), columns)]
        if sum(gaps + LETTER * length for length in longest) * TEXT / 72 <= width:
            return columns
    return 1


def figure_title(figure: "Figure", text: str) -> None:
    """Write `text` above the figure as it is: a file's name is no formula."""
    figure.suptitle(readable(text), fontsize=FIGURE_TITLE, parse_math=False)


def shortened(name: str, longest: int) -> str:
    """Return `name` on one line, its end replaced by an ellipsis if it has more than `longest` letters."""
    name = " ".join(readable(name).split())
    return name if len(name) <= longest else f"{name[: longest - 1]}…"


def no_formula(text: str) -> str:
    """Return `text` so that matplotlib shows it as it is, dollar signs included."""
    return readable(text).replace("$", r"\$")


def readable(text: str) -> str:
    """Return `text` with a question mark for what is no letter: names of files may be of any bytes."""
    return text.encode(errors="replace").decode()
