"""Figure of the fault components on their scale from 0 to 1 (friction also below) with 95 % intervals."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator import NAMES, Faults
from emaphm.actuator.faults import HEALTHY
from emaphm.plotting.style import (
    BLACK,
    BLUE,
    FAINT,
    LEGEND,
    PHONE_WIDTH,
    TEXT,
    VERMILION,
    new_figure,
    style_axis,
)
from emaphm.text_table import NOTHING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase

    from emaphm.diagnosis.result import Diagnosis
    from emaphm.diagnosis.verdict import Estimate

VERDICTS = {"healthy": (BLUE, "o"), "degraded": (VERMILION, "s")}
"""Colour and marker of a verdict."""

INCONCLUSIVE = (FAINT, "d")
"""Colour and marker of the verdict "cannot tell"."""

MARGIN = 0.03
"""Margin of the axis beyond the range of the components."""

TRUE_VALUE, HEALTHY_VALUE = "D", "|"
"""Markers of true and healthy values."""


def draw_faults(diagnosis: "Diagnosis", truth: Faults | None = None) -> "Figure":
    """Return the figure of the eight components with intervals, healthy values and true values (open)."""
    return draw_components(diagnosis.components, truth)


def draw_components(components: "Mapping[str, Estimate]", truth: Faults | None = None) -> "Figure":
    """Return the figure of the components without their diagnosis."""
    figure = new_figure(PHONE_WIDTH, 3.2)
    draw_fault_intervals(figure, components, truth)
    return figure


def draw_fault_intervals(
    figure: "FigureBase", components: "Mapping[str, Estimate]", truth: Faults | None
) -> None:
    """Draw the components on `figure`, which may be a subfigure."""
    axis = figure.subplots()
    for row, (name, estimate) in enumerate(components.items()):
        _component(axis, row, estimate)
        is_phase = name == "eccentricity_phase"  # no direction is healthy, or true without eccentricity
        if not is_phase:
            axis.plot(getattr(HEALTHY, name), row, HEALTHY_VALUE, color=BLACK, markersize=12)
        if truth and not (is_phase and truth.eccentricity == 0):
            axis.plot(getattr(truth, name), row, TRUE_VALUE, color=BLACK, markersize=8, fillstyle="none")
    friction = components["friction"].interval95[0]
    axis.set_xlim(min(0.0, friction, truth.friction if truth else 0.0) - MARGIN, 1 + MARGIN)
    axis.set_ylim(len(NAMES) - 0.5, -0.5)
    axis.set_yticks(range(len(NAMES)), NAMES)
    style_axis(axis, xlabel="normalised value and 95 % interval")
    for tick, estimate in zip(axis.get_yticklabels(), components.values(), strict=True):
        tick.set_color(BLACK if estimate.identifiable else FAINT)
    _legend(figure, axis, with_truth=truth is not None)


def _component(axis: "Axes", row: int, estimate: "Estimate") -> None:
    """Draw a component's interval and value, and write them to the right of the axis."""
    colour, marker = VERDICTS.get(estimate.verdict, INCONCLUSIVE)
    low, high = estimate.interval95
    # A direction's interval may extend past 0 or 1, where the circle closes: it continues at the other end.
    least, most = estimate.limits
    for turn in (-1, 0, 1) if low < least or high > most else (0,):
        ends = np.clip([low + turn, high + turn], least, most)
        if ends[0] < ends[1]:
            axis.plot(ends, [row, row], color=colour, linewidth=3, alpha=0.5, solid_capstyle="butt")
    ends_text = f"({low:z.4f} to {high:z.4f})"
    text = "not identifiable" if estimate.unconstrained else f"{NOTHING}  {ends_text}"
    if estimate.identifiable:
        text = f"{estimate.value:z.4f}  {ends_text}"
        axis.plot(estimate.value, row, marker, color=colour, markersize=5)
    shade = BLACK if estimate.identifiable else FAINT
    axis.text(1.02, row, text, transform=axis.get_yaxis_transform(), va="center", fontsize=TEXT, color=shade)


def _legend(figure: "FigureBase", axis: "Axes", *, with_truth: bool) -> None:
    for verdict, (colour, marker) in (VERDICTS | {"cannot tell": INCONCLUSIVE}).items():
        axis.plot([], [], marker, color=colour, markersize=5, label=verdict)
    axis.plot([], [], HEALTHY_VALUE, color=BLACK, markersize=12, label="healthy value")
    if with_truth:
        axis.plot([], [], TRUE_VALUE, color=BLACK, markersize=8, fillstyle="none", label="true value")
    figure.legend(loc="outside upper center", ncols=5, **LEGEND)
