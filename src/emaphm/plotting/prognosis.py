"""Figures of a prognosis: levels over time with limits, probability of failure, fan chart of the RUL."""

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator import COMPONENTS
from emaphm.arrays import Array, Flags
from emaphm.plotting.style import (
    BLUE,
    FAINT,
    PAGE_WIDTH,
    TITLE,
    VERMILION,
    figure_title,
    legend_above,
    legend_beside_title,
    log_axis,
    log_axis_from_zero,
    new_figure,
    no_formula,
    plain_numbers,
    shortened,
    style_axis,
)
from emaphm.prognosis.keeping.curves import PROBABILITIES, Curves

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from emaphm.prognosis.result import Prognosis

BANDS = ((0, 4, 0.18), (1, 3, 0.35))
"""Indices in `PROBABILITIES` of the ends of each band, and its opacity."""

MEDIAN = PROBABILITIES.index(0.5)

BAR = 8.0
"""Line width [pt] of the intervals of a life with only one forecast."""

LOW = 0.2
"""Share of the largest RUL in a fan below which a median is hardly readable on a linear axis."""

SHORT = 10.0
"""RUL [h] down to which the axis is then logarithmic; below, down to 0, it is linear if needed."""

MOST_VECTORS = 500
"""Diagnoses above which their marks are pixels: as vectors, those of 5,000 diagnoses take 12 MB."""

LONGEST_NAME = 40

NARROW_WIDTH = 4.0
"""Width [in] of a figure for a phone, whose text then has the size of the page's text."""


def draw_prognosis(prognosis: "Prognosis") -> "Figure":
    """Return the figure of the levels of all components over time and of the probability of failure."""
    curves = Curves.of(prognosis)
    figure = new_figure(PAGE_WIDTH, 7.5)
    parts = figure.subfigures(2, 1, squeeze=False, height_ratios=(3, 1.3)).ravel()
    _healths(parts[0], curves)
    axis = parts[1].subplots()
    _distribution(axis, curves)
    legend_beside_title(axis, columns=3)
    figure_title(figure, f"unit {shortened(curves.unit, LONGEST_NAME)}")
    return figure


def draw_health(curves: Curves, *, narrow: bool = False) -> "Figure":
    """Return the figure of the levels: diagnoses with 90 % intervals, forecast and limits of each component.

    `narrow` is for a phone: the components are in one column.
    """
    figure = new_figure(NARROW_WIDTH, 11.0) if narrow else new_figure(PAGE_WIDTH, 6.0)
    _healths(figure, curves, columns=1 if narrow else 2)
    return figure


def draw_life(curves: Curves, *, narrow: bool = False) -> "Figure":
    """Return the figure of the probability of failure over future hours; `narrow` is for a phone."""
    figure = new_figure(NARROW_WIDTH if narrow else PAGE_WIDTH, 2.6)
    axis = figure.subplots()
    _distribution(axis, curves)
    _legend(figure, axis, narrow=narrow)
    return figure


def draw_fan(curves: Curves, *, narrow: bool = False) -> "Figure":
    """Return the fan chart of the RUL: its quantiles forecast at earlier hours and now.

    `narrow` is for a phone.
    """
    figure = new_figure(NARROW_WIDTH if narrow else PAGE_WIDTH, 3.0)
    axis = figure.subplots()
    replacement_hours = sorted({hours for hours, _ in curves.replacements if hours > curves.fan[0][0]})
    hours, *quantiles = np.array(_fan_rows(curves, replacement_hours)).T
    _replacements(axis, replacement_hours, in_legend=bool(replacement_hours))
    is_forecast = np.isfinite(quantiles[MEDIAN])
    is_alone = _alone(is_forecast)
    for low, high, opacity in BANDS:
        ends, label = (quantiles[low], quantiles[high]), _band(low, high)
        if np.any(is_forecast & ~is_alone):
            axis.fill_between(hours, *ends, color=BLUE, alpha=opacity, linewidth=0, label=label)
            label = "_"  # once in the legend
        if np.any(is_alone):
            single = (values[is_alone] for values in (hours, *ends))
            axis.vlines(*single, color=BLUE, alpha=opacity, linewidth=BAR, label=label)
    axis.plot(hours, quantiles[MEDIAN], "o-", color=BLUE, markersize=3, label="median")
    style_axis(axis, "RUL as forecast", "flight hours [h]", f"RUL [h], at most {curves.longest:,.0f}")
    _rul_axis(axis, np.array(quantiles))
    plain_numbers(axis)
    _legend(figure, axis, narrow=narrow)
    return figure


def _fan_rows(curves: Curves, replacement_hours: "Sequence[float]") -> "list[tuple[float, ...]]":
    """Return the forecasts of the fan chart, with a row of NaN between the lives of an old and a new part.

    A replacement comes after the forecasts at its hours, except after the present one, the last of
    `curves.fan`. Of several forecasts of one life at the same hours, the last one counts.
    """
    *earlier, present = curves.fan
    rows: list[tuple[float, ...]] = []
    for begin, end in pairwise([-np.inf, *replacement_hours, np.inf]):
        life = {row[0]: row for row in earlier if begin < row[0] <= end}
        if end == np.inf:
            life[present[0]] = present
        rows += [*sorted(life.values()), (end, *[np.nan] * len(PROBABILITIES))]
    return rows[:-1]


def _alone(is_forecast: Flags) -> Flags:
    """Return which of the forecasts (n,) has no neighbour in its life: a band of it would have no width."""
    is_alone = is_forecast.copy()
    is_alone[1:] &= ~is_forecast[:-1]
    is_alone[:-1] &= ~is_forecast[1:]
    return is_alone


def _rul_axis(axis: "Axes", quantiles: Array) -> None:
    """Scale the axis of the RUL so that the smallest median of `quantiles` (5, n) is readable."""
    if np.nanmin(quantiles[MEDIAN]) >= LOW * np.nanmax(quantiles):
        axis.set_ylim(bottom=0)
        return
    if np.nanmin(quantiles) > SHORT:
        log_axis(axis, "y")
    else:
        log_axis_from_zero(axis, SHORT)
    axis.set_title("RUL as forecast, logarithmic", loc="left", fontsize=TITLE)


def _replacements(axis: "Axes", hours: "Sequence[float]", *, in_legend: bool) -> None:
    """Draw a line at the `hours` of each replacement."""
    for at in hours:
        axis.axvline(at, color="0.4", linewidth=0.8, linestyle="-.")
    if in_legend:
        axis.plot([], [], color="0.4", linewidth=0.8, linestyle="-.", label="replaced")


def _legend(figure: "Figure", axis: "Axes", *, narrow: bool) -> None:
    if narrow:
        legend_above(figure, *axis.get_legend_handles_labels())
    else:
        legend_beside_title(axis, columns=3)


def _healths(figure: "Figure | SubFigure", curves: Curves, columns: int = 2) -> None:
    """Draw the levels of all components, with one legend."""
    count = len(COMPONENTS)
    axes = figure.subplots(-(-count // columns), columns, sharex=True).ravel()
    for axis, name in zip(axes, COMPONENTS, strict=False):
        _health(axis, name, curves)
    for axis in axes[count:]:
        axis.set_visible(False)
    for axis in axes[count - columns : count]:
        axis.set_xlabel("flight hours [h]")
        axis.tick_params(labelbottom=True)
    plain_numbers(axes[0])  # for all axes, which share this one
    handles, labels = axes[0].get_legend_handles_labels()
    if count % columns:
        figure.legend(handles, labels, loc="lower right", frameon=False, fontsize=8)
    else:
        figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False, fontsize=8)


def _health(axis: "Axes", name: str, curves: Curves) -> None:
    """Draw diagnoses, forecast and limits of one component."""
    for explained, colour, label in ((True, "0.2", "diagnosis"), (False, FAINT, "diagnosis, not explained")):
        diagnoses = [diagnosis for diagnosis in curves.seen if diagnosis.explained is explained]
        if diagnoses:
            axis.errorbar(
                [diagnosis.hours for diagnosis in diagnoses],
                [diagnosis.levels[name] for diagnosis in diagnoses],
                [diagnosis.halves[name] for diagnosis in diagnoses],
                fmt="." if explained else "x",
                color=colour,
                markersize=4,
                linewidth=0.8,
                label=label,
                rasterized=len(diagnoses) > MOST_VECTORS,
            )
    levels = curves.levels[name]
    for low, high, opacity in BANDS:
        label = f"forecast, {_band(low, high)}"
        axis.fill_between(
            curves.times, levels[low], levels[high], color=BLUE, alpha=opacity, linewidth=0, label=label
        )
    axis.plot(curves.times, levels[MEDIAN], color=BLUE, linewidth=1, label="forecast, median")
    axis.axvline(curves.now, color=FAINT, linewidth=0.8, linestyle=":", label="now")
    replacement_hours = [hours for hours, part in curves.replacements if part in {name, "unit"}]
    _replacements(axis, replacement_hours, in_legend=bool(curves.replacements))
    for component, bound in curves.limits:
        if component == name:
            axis.axhline(bound, color=VERMILION, linewidth=1, linestyle="--")
    axis.plot([], [], color=VERMILION, linewidth=1, linestyle="--", label="limit")
    # Friction may be below healthy.
    lowest = [diagnosis.levels[name] - diagnosis.halves[name] for diagnosis in curves.seen]
    lowest += [bound for component, bound in curves.limits if component == name]
    axis.set_ylim(min(0.0, *lowest, *(min(row) for row in levels)) - 0.03, 1.03)
    style_axis(axis, name)


def _distribution(axis: "Axes", curves: Curves) -> None:
    """Draw the probability of failure over future hours, with the horizon."""
    axis.plot(curves.risk_times, curves.risk, color=BLUE, label="any requirement")
    if curves.first_label:
        label = no_formula(shortened(curves.first_label, LONGEST_NAME))
        axis.plot(curves.risk_times, curves.first_risk, color=VERMILION, linestyle="--", label=label)
    axis.axvline(curves.now + curves.horizon, color=FAINT, linestyle=":", label="horizon")
    axis.set_ylim(0, 1.02)
    style_axis(axis, "Risk of failure", "flight hours [h]", "probability")
    plain_numbers(axis)


def _band(low: int, high: int) -> str:
    return f"{100 * (PROBABILITIES[high] - PROBABILITIES[low]):.0f} %"
