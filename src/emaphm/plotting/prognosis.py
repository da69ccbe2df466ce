"""Figures of a prognosis: health over time with its limits, the fan chart of the RUL, the RUL over time."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array
from emaphm.plotting.style import (
    BLUE,
    FAINT,
    PAGE_WIDTH,
    VERMILION,
    figure_title,
    legend_beside_title,
    new_figure,
    no_formula,
    shortened,
    style_axis,
)
from emaphm.prognosis.requirements import COMPONENTS
from emaphm.prognosis.result import quantile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from emaphm.prognosis.result import Prognosis

BANDS = ((0.05, 0.95, 0.18), (0.25, 0.75, 0.35))
"""Lower and upper quantile of each band, and its opacity."""

LONGEST_NAME = 40

MOST_SHOWN = 3.0
"""The forecast is drawn as far as this multiple of the horizon, or 1.2 times the median of the RUL."""


def draw_prognosis(prognosis: "Prognosis") -> "Figure":
    """Draw the health of all components over time, and the distribution of the RUL."""
    figure = new_figure(PAGE_WIDTH, 7.5)
    parts = figure.subfigures(2, 1, squeeze=False, height_ratios=(3, 1.3)).ravel()
    _healths(parts[0], prognosis)
    _distribution(parts[1].subplots(), prognosis)
    figure_title(figure, f"unit {shortened(prognosis.evidence.unit, LONGEST_NAME)}")
    return figure


def draw_health(prognosis: "Prognosis") -> "Figure":
    """Draw the level of each component: diagnoses with 90 % intervals, filtered, forecast, and its limits."""
    figure = new_figure(PAGE_WIDTH, 6.0)
    _healths(figure, prognosis)
    return figure


def draw_life(prognosis: "Prognosis") -> "Figure":
    """Draw the probability of failure over the hours to come."""
    figure = new_figure(PAGE_WIDTH, 2.6)
    _distribution(figure.subplots(), prognosis)
    return figure


def draw_fan(prognosis: "Prognosis", past: list[tuple[float, Array]]) -> "Figure":
    """Draw the fan chart of the RUL: its quantiles as forecast at earlier hours, `past`, and now."""
    figure = new_figure(PAGE_WIDTH, 3.0)
    axis = figure.subplots()
    points = [*past, (prognosis.evidence.hours, prognosis.sample)]
    hours = np.array([at for at, _ in points])
    top = prognosis.paths.hours[-1]
    for low, high, opacity in BANDS:
        lower, upper = ([min(quantile(sample, p), top) for _, sample in points] for p in (low, high))
        label = f"{100 * (high - low):.0f} %"
        axis.fill_between(hours, lower, upper, color=BLUE, alpha=opacity, linewidth=0, label=label)
    axis.plot(
        hours, [min(quantile(s, 0.5), top) for _, s in points], "o-", color=BLUE, markersize=3, label="median"
    )
    axis.set_ylim(bottom=0)
    style_axis(axis, "RUL as forecast", "flight hours [h]", f"RUL [h], at most {top:,.0f}")
    legend_beside_title(axis, columns=3)
    return figure


def _healths(figure: "Figure | SubFigure", prognosis: "Prognosis") -> None:
    axes = figure.subplots(4, 2, sharex=True).ravel()
    for axis, name in zip(axes, COMPONENTS, strict=False):
        _health(axis, name, prognosis)
    axes[-1].set_visible(False)
    for axis in axes[-3:-1]:
        axis.set_xlabel("flight hours [h]")
        axis.tick_params(labelbottom=True)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower right", frameon=False, fontsize=8)


def _health(axis: "Axes", name: str, prognosis: "Prognosis") -> None:
    """Draw one component."""
    for explained, colour, label in ((True, "0.2", "diagnosis"), (False, FAINT, "diagnosis, not explained")):
        chosen = [one for one in prognosis.evidence.observations if one.explained is explained]
        if chosen:
            hours = [one.hours for one in chosen]
            seen = [float(_level(one.level, name)) for one in chosen]
            errors = [1.645 * np.sqrt(_variance(one.covariance, one.level, name)) for one in chosen]
            axis.errorbar(
                hours,
                seen,
                np.minimum(errors, 1.0),
                fmt="." if explained else "x",
                color=colour,
                markersize=4,
                linewidth=0.8,
                label=label,
            )
    now, made = prognosis.evidence.hours, prognosis.paths
    shown = made.hours <= _reach(prognosis)
    times = now + made.hours[shown]
    levels = np.clip(_level(made.level[shown], name), 0, 1)
    for low, high, opacity in BANDS:
        ends = np.quantile(levels, (low, high), axis=1)
        label = f"forecast, {100 * (high - low):.0f} %"
        axis.fill_between(times, *ends, color=BLUE, alpha=opacity, linewidth=0, label=label)
    axis.plot(times, np.median(levels, axis=1), color=BLUE, linewidth=1, label="forecast, median")
    axis.axvline(now, color=FAINT, linewidth=0.8, linestyle=":")
    for limit in prognosis.times.limits:
        if limit.component == name:
            axis.axhline(limit.bound, color=VERMILION, linewidth=1, linestyle="--")
    axis.plot([], [], color=VERMILION, linewidth=1, linestyle="--", label="limit")
    axis.set_ylim(-0.03, 1.03)
    style_axis(axis, name)


def _distribution(axis: "Axes", prognosis: "Prognosis") -> None:
    """Draw the probability of failure over the hours to come, with the horizon and the advice."""
    sample = np.sort(prognosis.sample)
    reach = _reach(prognosis)
    times = np.linspace(0, reach, 400)
    share = np.searchsorted(sample, times, "right") / sample.size
    axis.plot(prognosis.evidence.hours + times, share, color=BLUE, label="any requirement")
    if prognosis.limit is not None and len(prognosis.times.limits) > 1:
        row = np.sort(prognosis.times.hours[prognosis.times.limits.index(prognosis.limit)])
        label = no_formula(shortened(prognosis.limit.label, LONGEST_NAME))
        axis.plot(
            prognosis.evidence.hours + times,
            np.searchsorted(row, times, "right") / row.size,
            color=VERMILION,
            linestyle="--",
            label=label,
        )
    axis.axvline(prognosis.evidence.hours + prognosis.horizon, color=FAINT, linestyle=":", label="horizon")
    axis.set_ylim(0, 1.02)
    style_axis(axis, "probability of failure", "flight hours [h]")
    legend_beside_title(axis, columns=3)


def _reach(prognosis: "Prognosis") -> float:
    """Return how far into the future is drawn [h]."""
    median = prognosis.median if np.isfinite(prognosis.median) else 0.0
    longest = float(prognosis.paths.hours[-1])
    return min(max(MOST_SHOWN * prognosis.horizon, 1.2 * median), longest)


def _level(levels: Array, name: str) -> Array:
    """Return a component's levels (…) of those of all coordinates (…, 8)."""
    if name != "eccentricity":
        return np.asarray(levels[..., CARTESIAN_NAMES.index(name)])
    x = CARTESIAN_NAMES.index("eccentricity_x")
    return np.hypot(levels[..., x], levels[..., x + 1])


def _variance(covariance: Array, level: Array, name: str) -> float:
    """Return a component's variance of the covariance (8, 8) of a diagnosis with that level (8,)."""
    if name != "eccentricity":
        column = CARTESIAN_NAMES.index(name)
        return float(covariance[column, column])
    x = CARTESIAN_NAMES.index("eccentricity_x")
    along = level[x : x + 2] / max(float(np.hypot(*level[x : x + 2])), 1e-12)
    return max(float(along @ covariance[x : x + 2, x : x + 2] @ along), 0.0)
