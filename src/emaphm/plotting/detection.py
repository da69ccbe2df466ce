"""Figures of the detector: T² and Q relative to their thresholds, and their contributions."""

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
"""Largest number of characters of a recording's name in a title."""

MOST_SEGMENTS = 30
"""Largest number of labelled segments on the axis; of more, every second, third, … is labelled."""

LOWEST_RATIO = 0.3
"""Ratio to the threshold down to which the axis extends at least, so that it contains the threshold."""


def draw_detection(result: DetectorResult) -> "Figure":
    """Return the figure of T² and Q over their thresholds, and contributions by channel and segment."""
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
    """Return the figure of T² over Q, relative to their thresholds, with one marker per result of each set.

    A ratio of zero is drawn below all other ratios, because the axes are logarithmic; the label states this.
    """
    figure = new_figure(PAGE_WIDTH, 4.6)
    axis = figure.subplots()
    pairs = [
        (result.q / result.q_threshold, result.t2 / result.t2_threshold) for result in chain(*sets.values())
    ]
    floors = [_floor([pair[i] for pair in pairs]) for i in (0, 1)]
    handles = []
    for k, (name, results) in enumerate(sets.items()):
        (line,) = axis.plot(
            [max(result.q / result.q_threshold, floors[0]) for result in results],
            [max(result.t2 / result.t2_threshold, floors[1]) for result in results],
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
    """Return the value at which a ratio of zero is drawn: a tenth of the smallest positive ratio."""
    return min((ratio for ratio in ratios if ratio > 0), default=1.0) / 10


def _ratios(axis: "Axes", result: DetectorResult) -> None:
    """Draw each ratio as a bar from the threshold, on a logarithmic axis that contains both."""
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
    """Draw contributions to the statistic with the larger ratio: a map, or bars for a single channel."""
    segments = list(result.by_segment)
    by_q = result.q / result.q_threshold >= result.t2 / result.t2_threshold
    shares = np.zeros((len(segments), len(channels)))
    for contribution in result.contributions:
        shares[segments.index(contribution.segment), channels.index(contribution.channel)] += (
            contribution.q if by_q else contribution.t2
        )
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
