"""Figures of the study of predictions on a synthetic fleet."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from emaphm.plotting.style import (
    BLACK,
    BLUE,
    FAINT,
    LEGEND,
    MARKERS,
    PAGE_WIDTH,
    SERIES,
    new_figure,
    style_axis,
)
from emaphm.study.fleet.acting import acted
from emaphm.study.fleet.judging import (
    ALONE,
    ALPHA,
    CLAIRVOYANT,
    FILTER,
    INFORMED,
    LAW_AND_LEVEL,
    LINE,
    LIVES,
    MEAN,
    SHARES,
    WITH_FLEET,
)
from emaphm.study.fleet.scores import alpha_lambda_interval, scores
from emaphm.study.fleet.tracks import BY_COSTS, BY_RISK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = (WITH_FLEET, ALONE, CLAIRVOYANT, LAW_AND_LEVEL, INFORMED, FILTER, LINE, MEAN)

COLOURS = dict(
    zip(SHOWN, (BLUE, SERIES[5], BLACK, SERIES[4], SERIES[3], SERIES[2], SERIES[1], SERIES[7]), strict=True)
)

ACTED = {LIVES if way == MEAN else way: colour for way, colour in COLOURS.items()}
"""Colours of the ways of predicting for removals, which use the fleet's lives instead of their mean."""

MARKS = dict(zip(ACTED, MARKERS, strict=False)) | dict(zip(SHOWN, MARKERS, strict=False))
"""Markers of the ways, for grey print and colour-blind readers."""

MOST_TRACKS = 6
"""Largest number of units whose predictions over life are drawn."""

BINS = 10
"""Bins of the histogram of the probability integral transform."""


def draw_scores(units: Sequence[Mapping[str, Any]]) -> "Figure":
    """Return the figure of alpha-lambda with its 90 % interval, and of CRPS, by way and share of life."""
    figure = new_figure(PAGE_WIDTH, 3.4)
    good, error = figure.subplots(1, 2)
    places = np.arange(len(SHARES), dtype=float)
    for i, way in enumerate(SHOWN):
        scores_by_share = [scores(units, way, share) for share in SHARES]
        shift = 0.06 * (i - (len(SHOWN) - 1) / 2)
        value = np.array([score.alpha_lambda for score in scores_by_share])
        ends = np.array([alpha_lambda_interval(score) for score in scores_by_share]).T
        good.errorbar(
            places + shift,
            value,
            np.abs(ends - value),
            fmt=f"{MARKS[way]}-",
            color=COLOURS[way],
            markersize=4,
            linewidth=1,
            label=way,
        )
        error.plot(
            places,
            [score.crps for score in scores_by_share],
            f"{MARKS[way]}-",
            color=COLOURS[way],
            markersize=4,
            linewidth=1,
        )
    for axis in (good, error):
        axis.set_xticks(places, [f"{share:g}" for share in SHARES])
    good.set_ylim(-0.02, 1.02)
    error.set_yscale("log")
    style_axis(good, "alpha-lambda, with 90 % interval", "share of life λ", "share of synthetic units")
    style_axis(error, "CRPS: lower is better", "share of life λ", "CRPS [h]")
    handles, labels = good.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, **LEGEND)
    return figure


def draw_tracks(units: Sequence[Mapping[str, Any]]) -> "Figure":
    """Return the figure of the RUL predicted with the fleet's prior over some units' lives, and true RUL."""
    tracked = [unit for unit in units if unit["tracks"]]
    drawn = [tracked[i] for i in np.linspace(0, len(tracked) - 1, min(MOST_TRACKS, len(tracked))).astype(int)]
    figure = new_figure(PAGE_WIDTH, 4.6)
    for axis, unit in zip(figure.subplots(2, 3).ravel(), drawn, strict=False):
        _track(axis, unit)
    return figure


def _track(axis: "Axes", unit: Mapping[str, Any]) -> None:
    """Draw the predicted and the true RUL over the life of a unit."""
    hours, low, median, high, _ = np.array(unit["tracks"][WITH_FLEET]["track"]).T
    failure = unit["failure"]
    true = failure - hours
    axis.fill_between(hours, low, high, color=BLUE, alpha=0.2, linewidth=0, label="90 %")
    axis.plot(hours, median, "o-", color=BLUE, markersize=2.5, linewidth=0.8, label="median")
    axis.plot(hours, true, color=BLACK, linewidth=1, label="true")
    for side in (1 - ALPHA, 1 + ALPHA):
        axis.plot(hours, side * true, ":", color=FAINT, linewidth=1)
    axis.set_ylim(0, 1.6 * failure)
    style_axis(axis, f"{unit['failed']}: {unit['law']}", "flight hours [h]", "RUL [h]")


def draw_acting(units: Sequence[Mapping[str, Any]]) -> "Figure":
    """Return the figure of failures in service and wasted life, by way of predicting and rule."""
    figure = new_figure(PAGE_WIDTH, 3.4)
    panels = {BY_RISK: "removed by the risk", BY_COSTS: "removed by the costs"}
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    for axis, (rule, title) in zip(axes, panels.items(), strict=True):
        for way, colour in ACTED.items():
            rates = acted(units, way, rule)
            axis.plot(
                100 * rates.failed, 100 * rates.wasted, MARKS[way], color=colour, markersize=6, label=way
            )
        style_axis(axis, title, "fail in service [%]", "life wasted [%]" if rule == BY_RISK else "")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, **LEGEND)
    return figure


def draw_calibration(units: Sequence[Mapping[str, Any]]) -> "Figure":
    """Return histograms of the probability integral transform by share of life; uniform if calibrated."""
    figure = new_figure(PAGE_WIDTH, 2.4)
    edges = np.linspace(0, 1, BINS + 1)
    for axis, share in zip(figure.subplots(1, len(SHARES), sharey=True), SHARES, strict=True):
        for way, style in ((WITH_FLEET, "-"), (ALONE, ":")):
            values = [unit["ways"][way][str(share)]["transform"] for unit in units]
            counts, _ = np.histogram(values, edges)
            axis.stairs(counts / len(values), edges, color=COLOURS[way], linestyle=style, linewidth=1.5)
        axis.axhline(1 / BINS, color=FAINT, linewidth=0.8)
        style_axis(axis, f"λ = {share:g}", "P(RUL < true)", "share of units" if share == SHARES[0] else "")
    return figure
