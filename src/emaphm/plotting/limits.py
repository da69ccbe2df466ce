"""Figures of the map of limits: error, coverage and alarms over the varied condition of a section."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from emaphm.plotting.style import LEGEND, MARKERS, PAGE_WIDTH, SERIES, Dashes
from emaphm.study.analysis.limits import SettingRates
from emaphm.study.plan import PageRow, PageSection

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Line = tuple[str, Dashes, str]
"""Name, dashes and marker of a line."""

PANELS: dict[str, dict[str, Line]] = {
    "error [%]": {"median": ("median", "-", "o"), "p95": ("95th percentile", ":", "o")},
    "share of random faults [%]": {
        "mean_coverage": ("covered, mean", "-", "o"),
        "least_coverage": ("covered, least", ":", "o"),
        "explained": ("explained", "--", "x"),
    },
    "share of components [%]": {
        "detection": ("small faults detected", "-", "o"),
        "false_alarms": ("false alarms", ":", "o"),
    },
}
"""Panels by their title: fields of `SettingRates`, each with its line."""

DECADES = (0.1, 0.3, 1, 3, 10, 30, 100)
"""Errors [%] at the ticks, within the range of the panel."""

Rates = Mapping[PageRow, SettingRates]


def draw_limits(section: PageSection, rates: Rates) -> "Figure":
    """Return the figure of a section: three panels over its equally spaced rows, one colour per method."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PAGE_WIDTH, 2.9), layout="constrained")
    for panel, (title, lines) in zip(figure.subplots(1, 3), PANELS.items(), strict=True):
        _panel(panel, title, lines, section, rates)
    return figure


def _panel(panel: "Axes", title: str, lines: dict[str, Line], section: PageSection, rates: Rates) -> None:
    is_error_panel = "median" in lines
    texts = list(dict.fromkeys(row.text for row in section.rows))
    methods = list(dict.fromkeys(row.method for row in section.rows))
    scale = 1.0 if is_error_panel else 100.0
    for method, (colour, method_marker) in _looks(methods).items():
        rows = [row for row in section.rows if row.method == method]
        places = [texts.index(row.text) for row in rows]
        for field, (_, dashes, marker) in lines.items():
            values = [scale * getattr(rates[row], field) for row in rows]
            drawn_marker = method_marker or marker
            panel.plot(
                places,
                values,
                dashes,
                color=colour,
                marker=drawn_marker,
                markersize=6 if drawn_marker == "x" else 3,
            )
    if is_error_panel:
        _logarithmic(panel)
    else:
        panel.set_ylim(-3, 103)
    if "mean_coverage" in lines:
        panel.axhline(95, color="0.7", linewidth=0.8, zorder=0)
    panel.set_xticks(range(len(texts)), texts, fontsize=8)
    panel.set_xlim(-0.3, len(texts) - 0.7)
    panel.tick_params(axis="y", labelsize=8)
    panel.set_xlabel(section.label, fontsize=8)
    panel.set_title(title, fontsize=9)
    panel.grid(alpha=0.3)
    _legend(panel, lines, methods if is_error_panel and len(methods) > 1 else [])


def _looks(methods: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Return each method's colour, and a marker if the colours repeat (otherwise that of the line)."""
    markers = ("", *MARKERS[1:])
    return {
        method: (SERIES[i % len(SERIES)], markers[i // len(SERIES) % len(markers)])
        for i, method in enumerate(methods)
    }


def _legend(panel: "Axes", lines: dict[str, Line], methods: list[str]) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color="0.2", linestyle=dashes, marker=marker, markersize=4)
        for _, dashes, marker in lines.values()
    ]
    handles += [
        Line2D([], [], color=colour, marker=method_marker, markersize=4)
        for colour, method_marker in _looks(methods).values()
    ]
    names = [*(name for name, _, _ in lines.values()), *methods]
    panel.legend(handles, names, loc="upper center", bbox_to_anchor=(0.5, -0.26), **LEGEND)


def _logarithmic(panel: "Axes") -> None:
    """Make the axis of errors logarithmic, with plain numbers."""
    from matplotlib.ticker import NullLocator

    panel.set_yscale("log")
    low, high = panel.get_ylim()
    low, high = min(low, 0.3), max(high, 3.0)
    ticks = [value for value in DECADES if low <= value <= high]
    panel.set_ylim(low, high)
    panel.set_yticks(ticks, [f"{value:g}" for value in ticks])
    panel.yaxis.set_minor_locator(NullLocator())
