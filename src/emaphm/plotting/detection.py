"""Figures of the detector: T² and Q against their thresholds, and where they come from."""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from emaphm.detection.result import DetectorResult
from emaphm.plotting.style import (
    BLUE,
    DARK,
    FAINT,
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

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LONGEST_NAME = 60
"""Letters of a recording's name in a title."""


def draw_detection(result: DetectorResult) -> "Figure":
    """Draw T² and Q relative to their thresholds, and the contributions by channel and segment."""
    channels = list(result.by_channel)
    figure = new_figure(PAGE_WIDTH, 2.6 + 0.35 * len(channels))
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
    ratios = {"T²": result.t2 / result.t2_threshold, "Q": result.q / result.q_threshold}
    colours = [VERMILION if ratio > 1 else BLUE for ratio in ratios.values()]
    axis.bar(list(ratios), list(ratios.values()), color=colours, width=0.6)
    axis.axhline(1, color=DARK, linewidth=1, linestyle="--")
    for place, ratio in enumerate(ratios.values()):
        axis.annotate(f"{ratio:.2g}", (place, ratio), ha="center", va="bottom", fontsize=TEXT, color=DARK)
    style_axis(axis, "", "", "× threshold")


def _contributions(axis: "Axes", result: DetectorResult, channels: Sequence[str]) -> None:
    segments = list(result.by_segment)
    by_q = result.q / result.q_threshold >= result.t2 / result.t2_threshold
    shares = np.zeros((len(channels), len(segments)))
    for one in result.contributions:
        shares[channels.index(one.channel), segments.index(one.segment)] += one.q if by_q else one.t2
    total = shares.sum() or 1.0
    image = axis.imshow(100 * shares / total, aspect="auto", cmap="Blues", vmin=0)
    axis.figure.colorbar(image, ax=axis, label=f"share of {'Q' if by_q else 'T²'} [%]")
    style_axis(axis)
    axis.grid(visible=False)
    axis.set_yticks(range(len(channels)), channels)
    step = max(1, len(segments) // 12)
    places = range(0, len(segments), step)
    axis.set_xticks(places, [segments[k] for k in places], rotation=40, ha="right", color=FAINT)
