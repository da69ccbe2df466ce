"""Figures of the detector: T² and Q against their thresholds, and where they come from."""

from collections.abc import Mapping, Sequence
from itertools import chain
from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from emaphm.detection.result import DetectorResult
from emaphm.plotting.style import (
    BLUE,
    DARK,
    MARKERS,
    PAGE_WIDTH,
    SERIES,
    TEXT,
    VERMILION,
    figure_title,
    legend_above,
    log_axis,
    new_figure,
    shortened,
    style_axis,
)
from emaphm.text_table import with_digits

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LONGEST_NAME = 60
"""Letters of a recording's name in a title."""

MOST_SEGMENTS = 30
"""Segments along the axis that are named; of more, every second, third and so on"""

LOWEST_RATIO = 0.3
"""Ratio to the threshold down to which the axis goes at least, so that the threshold is inside of it."""


def draw_detection(result: DetectorResult) -> "Figure":
    """Draw T² and Q relative to their thresholds, and the contributions by channel and segment."""
    channels = list(result.by_channel)
    figure = new_figure(PAGE_WIDTH, 2.0 + 0.16 * min(len(result.by_segment), MOST_SEGMENTS))
    ratios, map_axis = figure.subplots(1, 2, width_ratios=(1, 3))
    _ratios(ratios, result)
    _contributions(map_axis, result, channels)
    figure_title(
        figure,
        f"{shortened(result.recording, LONGEST_NAME)}: "
        f"{'like healthy' if result.like_healthy else 'not like healthy'}",
    )
    return figure


def draw_detected_sets(sets: Mapping[str, Sequence[DetectorResult]]) -> "Figure":
    """Draw T² over Q of the results of each set, both relative to their thresholds, a mark each.

    A ratio of zero, which a logarithmic axis lacks, is drawn below all others, and the axis says so.
    """
    figure = new_figure(PAGE_WIDTH, 4.6)
    axis = figure.subplots()
    pairs = [(one.q / one.q_threshold, one.t2 / one.t2_threshold) for one in chain(*sets.values())]
    floors = [_floor([pair[i] for pair in pairs]) for i in (0, 1)]
    handles = []
    for k, (name, results) in enumerate(sets.items()):
        (line,) = axis.plot(
            [max(one.q / one.q_threshold, floors[0]) for one in results],
            [max(one.t2 / one.t2_threshold, floors[1]) for one in results],
            linestyle="none",
            marker=MARKERS[k % len(MARKERS)],
            color=SERIES[k % len(SERIES)],
            markersize=5,
            label=name,
        )
        handles.append(line)
    axis.axhline(1, color=DARK, linewidth=1, linestyle="--")
    axis.axvline(1, color=DARK, linewidth=1, linestyle="--")
    log_axis(axis, "xy")
    q, t2 = (
        f"{name} / threshold{f', 0 at {floor:.1g}' if any(pair[i] == 0 for pair in pairs) else ''}"
        for i, (name, floor) in enumerate(zip(("Q", "T²"), floors, strict=True))
    )
    style_axis(axis, "", q, t2)
    legend_above(figure, handles, list(sets))
    return figure


def _floor(ratios: Sequence[float]) -> float:
    """Return where a ratio of zero is drawn: a tenth of the least other one."""
    return min((ratio for ratio in ratios if ratio > 0), default=1.0) / 10


def _ratios(axis: "Axes", result: DetectorResult) -> None:
    """Draw each ratio by its distance from the threshold, on a scale where both are visible however far."""
    ratios = {"T²": result.t2 / result.t2_threshold, "Q": result.q / result.q_threshold}
    floor = min([LOWEST_RATIO, *(ratio / 2 for ratio in ratios.values() if ratio > 0)])
    for place, ratio in enumerate(ratios.values()):
        colour, marker, side = (VERMILION, "s", 1) if ratio > 1 else (BLUE, "o", -1)
        height = max(ratio, floor)
        axis.plot([place, place], [1, height], color=colour, linewidth=3, alpha=0.5, solid_capstyle="butt")
        axis.plot(place, height, marker, color=colour, markersize=6)
        axis.annotate(
            with_digits(ratio),
            (place, height),
            xytext=(0, 5 * side),
            textcoords="offset points",
            ha="center",
            va="bottom" if side > 0 else "top",
            fontsize=TEXT,
            color=DARK,
        )
    axis.axhline(1, color=DARK, linewidth=1, linestyle="--")
    axis.set_xlim(-0.6, len(ratios) - 0.4)
    axis.set_ylim(floor, 3 * max(1.0, *ratios.values()))
    log_axis(axis, "y")
    axis.set_xticks(range(len(ratios)), list(ratios))
    style_axis(axis, "", "", "ratio to the threshold (dashed)")
    axis.grid(visible=False, axis="x")


def _contributions(axis: "Axes", result: DetectorResult, channels: Sequence[str]) -> None:
    """Draw the shares in the statistic that exceeds its threshold most: a map, or bars of one channel."""
    segments = list(result.by_segment)
    by_q = result.q / result.q_threshold >= result.t2 / result.t2_threshold
    shares = np.zeros((len(segments), len(channels)))
    for one in result.contributions:
        shares[segments.index(one.segment), channels.index(one.channel)] += one.q if by_q else one.t2
    shares *= 100 / (shares.sum() or 1.0)
    label = f"share of {'Q' if by_q else 'T²'} [%]"
    if len(channels) == 1:
        axis.barh(range(len(segments)), shares[:, 0], color=BLUE, height=0.7)
        axis.set_ylim(len(segments) - 0.5, -0.5)
        style_axis(axis, f"{channels[0]}, by segment", label)
        axis.grid(visible=False, axis="y")
    else:
        image = axis.imshow(shares, aspect="auto", cmap="Blues", vmin=0)
        style_axis(axis, "By segment and channel")
        axis.grid(visible=False)
        axis.set_xticks(range(len(channels)), channels, rotation=20, ha="right", rotation_mode="anchor")
        bar = axis.figure.colorbar(image, ax=axis)
        bar.set_label(label, fontsize=TEXT)
        bar.ax.tick_params(labelsize=TEXT)
    places = range(0, len(segments), ceil(len(segments) / MOST_SEGMENTS))
    axis.set_yticks(places, [segments[k] for k in places])
