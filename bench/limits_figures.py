"""Figures of the map of the limits: error, coverage and alarms along one axis."""

from typing import TYPE_CHECKING, Literal

from bench.limits import Axis, Figures, Outcomes
from emaphm.plotting.style import LEGEND, PAGE_WIDTH, SERIES
from emaphm.plotting.svg import plain_style, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Dashes = Literal["-", "--", ":"]

Line = tuple[str, Dashes, str]
"""What a line is called, its dashes and its marker."""

PANELS: dict[str, dict[str, Line]] = {
    "error [%]": {"median": ("median", "-", "o"), "most": ("95th percentile", ":", "o")},
    "share of random faults [%]": {
        "mean_coverage": ("covered, mean", "-", "o"),
        "least_coverage": ("covered, least", ":", "o"),
        "explained": ("explained", "--", "x"),
    },
    "share of components [%]": {
        "detection": ("5 % faults detected", "-", "o"),
        "false_alarms": ("false alarms", ":", "o"),
    },
}
"""By what a panel shows: the fields of `Figures` in it, each with its line."""

DECADES = (0.1, 0.3, 1, 3, 10, 30, 100)
"""Errors [%] that are marked, of those that the panel spans."""


def draw(axis: Axis, outcomes: Outcomes) -> bytes:
    """Return the figure of an axis as SVG: three panels over its values, evenly spaced."""
    from matplotlib.figure import Figure

    with plain_style():
        figure = Figure(figsize=(PAGE_WIDTH, 2.9), layout="constrained")
        for panel, (title, lines) in zip(figure.subplots(1, 3), PANELS.items(), strict=True):
            _panel(panel, title, lines, axis, outcomes)
        return svg(figure)


def _panel(panel: "Axes", title: str, lines: dict[str, Line], axis: Axis, outcomes: Outcomes) -> None:
    from matplotlib.lines import Line2D

    errors = "median" in lines
    places = {value: i for i, value in enumerate(axis.curves[0].values)}
    scale = 1.0 if errors else 100.0
    for curve, colour in zip(axis.curves, SERIES, strict=False):
        points = [
            (places[value], Figures.of(setting, outcomes))
            for one, value, setting in axis.points()
            if one is curve
        ]
        for field, (_, dashes, marker) in lines.items():
            shown = [scale * getattr(figures, field) for _, figures in points]
            size = 3 if marker == "o" else 6
            panel.plot([x for x, _ in points], shown, dashes, color=colour, marker=marker, markersize=size)
    if errors:
        _logarithmic(panel)
    else:
        panel.set_ylim(-3, 103)
    if "mean_coverage" in lines:
        panel.axhline(95, color="0.7", linewidth=0.8, zorder=0)
    panel.set_xticks(range(len(places)), [axis.write(value) for value in places], fontsize=8)
    panel.set_xlim(-0.3, len(places) - 0.7)
    panel.tick_params(axis="y", labelsize=8)
    panel.set_xlabel(axis.label, fontsize=8)
    panel.set_title(title, fontsize=9)
    panel.grid(alpha=0.3)
    handles = [
        Line2D([], [], color="0.2", linestyle=dashes, marker=marker, markersize=4)
        for _, dashes, marker in lines.values()
    ]
    several = len(axis.curves) > 1 and errors
    colours = [Line2D([], [], color=colour) for colour, _ in zip(SERIES, axis.curves, strict=False)]
    panel.legend(
        handles + (colours if several else []),
        [
            *(name for name, _, _ in lines.values()),
            *([curve.name.partition(" (")[0] for curve in axis.curves] if several else []),
        ],
        loc="upper center",
        bbox_to_anchor=(0.5, -0.26),
        **LEGEND,
    )


def _logarithmic(panel: "Axes") -> None:
    """Make the axis of errors logarithmic, with plain marks."""
    from matplotlib.ticker import NullLocator

    panel.set_yscale("log")
    low, high = panel.get_ylim()
    low, high = min(low, 0.3), max(high, 3.0)
    marked = [value for value in DECADES if low <= value <= high]
    panel.set_ylim(low, high)
    panel.set_yticks(marked, [f"{value:g}" for value in marked])
    panel.yaxis.set_minor_locator(NullLocator())
