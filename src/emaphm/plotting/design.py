"""Figure of a test design: commands, and the predicted half-widths of the intervals."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator.quantity import USER_ANGLE, unit_for
from emaphm.diagnosis.verdict import VERDICT
from emaphm.plotting.style import (
    BLUE,
    FAINT,
    LEGEND,
    PAGE_WIDTH,
    VERMILION,
    Dashes,
    figure_title,
    log_axis,
    new_figure,
    style_axis,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from emaphm.experiment.candidate_search import PlannedTest
    from emaphm.experiment.result import Design

GIVEN, FOUND = "given", "found"

LOOKS: "Mapping[str, tuple[str, str, Dashes]]" = {GIVEN: (BLUE, "o", "--"), FOUND: (VERMILION, "s", "-")}
"""Colour, marker and line; marker and line are distinguishable in grey print."""

POINTS = 2000
"""Number of points of a command's line."""


def draw_design(design: "Design") -> "Figure":
    """Return the figure of the given and the found excitation (if any), above half-widths by component."""
    plans = {GIVEN: design.given} | ({FOUND: design.found} if design.better else {})
    actuator = design.setup.actuator
    figure = new_figure(PAGE_WIDTH, 6.4)
    commands, widths = figure.subplots(2, 1, height_ratios=(1, 1.4))
    _commands(commands, plans, actuator.coordinates)
    _widths(widths, plans)
    figure_title(figure, f"Test of actuator {actuator.name}, recorded: {', '.join(design.setup.channels)}")
    return figure


def _commands(axis: "Axes", plans: "Mapping[str, PlannedTest]", coordinates: str) -> None:
    for label, plan in plans.items():
        excitation = plan.excitation
        t = np.linspace(0.0, excitation.duration, POINTS)
        words = f"{label}: {excitation.words(coordinates)}"
        colour, _, line = LOOKS[label]
        axis.plot(t, excitation.command(t), line, color=colour, linewidth=1.2, label=words)
    style_axis(axis, "", "time [s]", f"command [{unit_for(USER_ANGLE, coordinates)}]")
    axis.legend(loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2, **LEGEND)


def _widths(axis: "Axes", plans: "Mapping[str, PlannedTest]") -> None:
    """Draw a row per component: predicted (open marker) and simulated half-width (filled), and a line."""
    names = list(plans[GIVEN].predicted.half_widths)
    rows = np.arange(len(names))
    shifts = np.linspace(-0.15, 0.15, len(plans)) if len(plans) > 1 else [0.0]
    for shift, (label, plan) in zip(shifts, plans.items(), strict=True):
        colour, marker, _ = LOOKS[label]
        predicted = [plan.predicted.half_widths[name] for name in names]
        axis.plot(
            predicted, rows + shift, marker, color=colour, fillstyle="none", label=f"{label}, predicted"
        )
        if plan.simulated is not None:
            simulated = [plan.simulated.precision.half_widths[name] for name in names]
            axis.plot(simulated, rows + shift, marker, color=colour, label=f"{label}, simulated")
            axis.hlines(rows + shift, predicted, simulated, color=colour, linewidth=1.2)
    limit = f"identifiable below {VERDICT.longest_interval / 2:g}"
    axis.axvline(VERDICT.longest_interval / 2, color=FAINT, linestyle="--", linewidth=1, label=limit)
    axis.set_yticks(rows, names)
    axis.set_ylim(len(names) - 0.5, -0.5)
    log_axis(axis, "x")
    style_axis(axis, "", "half-width of the 95 % interval, as a fraction of the component's scale", "")
    axis.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, borderaxespad=0.2, **LEGEND)
