"""The figure of a design: commands, and the half-widths that are expected of them and proven."""

from typing import TYPE_CHECKING, Any

import numpy as np

from emaphm.actuator.quantity import unit_for
from emaphm.diagnosis.verdict import VERDICT
from emaphm.experiment.candidate_search import PlannedTest
from emaphm.experiment.result import Design
from emaphm.plotting.diagnosis import FAINT, LEGEND, MODELLED, RESIDUAL

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOOKS = {"given": (RESIDUAL, "o", "--"), "found": (MODELLED, "s", "-")}
"""Colour, marker and line: to be told apart in grey print, too."""

POINTS = 2000
"""Of a command's line."""

TEXT: dict[str, Any] = {"fontsize": 9}


def draw_design(design: Design) -> "Figure":
    """Draw the given excitation and the one found, if any, above their half-widths by component."""
    from matplotlib.figure import Figure

    plans = {"given": design.given} | ({"found": design.found} if design.better else {})
    figure = Figure(figsize=(8, 6.4), layout="constrained")
    commands, widths = figure.subplots(2, 1, height_ratios=(1, 1.4))
    coordinates = design.setup.actuator.coordinates
    _commands(commands, plans, coordinates)
    _widths(widths, plans)
    for axis in (commands, widths):
        axis.tick_params(which="both", labelsize=8)
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
    figure.suptitle(
        f"Test of actuator {design.setup.actuator.name}, recorded: {', '.join(design.setup.channels)}",
        fontsize=10,
        parse_math=False,
    )
    return figure


def _commands(axis: "Axes", plans: dict[str, PlannedTest], coordinates: str) -> None:
    for label, plan in plans.items():
        excitation = plan.excitation
        t = np.linspace(0.0, excitation.duration, POINTS)
        words = f"{label}: {excitation.words(coordinates)}"
        colour, _, line = LOOKS[label]
        axis.plot(t, excitation.command(t), line, color=colour, linewidth=1.2, label=words)
    axis.set_xlabel("time [s]", **TEXT)
    axis.set_ylabel(f"command [{unit_for('rad', coordinates)}]", **TEXT)
    axis.legend(loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2, **LEGEND)


def _widths(axis: "Axes", plans: dict[str, PlannedTest]) -> None:
    """Draw a row for each component: expected as open markers, proven as filled ones, a line between."""
    names = list(plans["given"].predicted.half_widths)
    rows = np.arange(len(names))
    shifts = np.linspace(-0.15, 0.15, len(plans)) if len(plans) > 1 else [0.0]
    for shift, (label, plan) in zip(shifts, plans.items(), strict=True):
        colour, marker, _ = LOOKS[label]
        before = [plan.predicted.half_widths[name] for name in names]
        axis.plot(before, rows + shift, marker, color=colour, fillstyle="none", label=f"{label}, expected")
        if plan.simulated is not None:
            after = [plan.simulated.precision.half_widths[name] for name in names]
            axis.plot(after, rows + shift, marker, color=colour, label=f"{label}, proven")
            axis.hlines(rows + shift, before, after, color=colour, linewidth=1.2)
    axis.axvline(
        VERDICT.longest_interval / 2, color=FAINT, linestyle="--", linewidth=1, label="cannot be told beyond"
    )
    axis.set_yticks(rows, [name.replace("_", " ") for name in names])
    axis.set_ylim(len(names) - 0.5, -0.5)
    axis.set_xscale("log")
    axis.set_xlabel("half-width of the 95 % interval, as a share of the fault's range", **TEXT)
    axis.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, borderaxespad=0.2, **LEGEND)
