"""The figure of a design: commands and expected half-widths, before and after."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator.quantity import unit_for
from emaphm.identification.design import Design
from emaphm.identification.figures import LEGEND, MODELLED, RECORDED
from emaphm.identification.verdict import WIDEST_HALF_INTERVAL

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_design(design: Design) -> "Figure":
    """Draw `design` on one page."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 6), layout="constrained")
    commands, widths = figure.subplots(2, 1)
    for label, chirp, colour in (("given", design.given, RECORDED), ("found", design.found, MODELLED)):
        t = np.linspace(0.0, chirp.duration, 1000)
        commands.plot(t, chirp(t), color=colour, label=label, linewidth=1.2)
    commands.set_xlabel("time [s]")
    commands.set_ylabel(f"command [{unit_for('rad', design.actuator.coordinates)}]")
    commands.legend(**LEGEND)
    names = list(design.before.half_widths)
    rows = np.arange(len(names))
    for shift, expected, colour in ((-0.2, design.before, RECORDED), (0.2, design.after, MODELLED)):
        widths.barh(rows + shift, [expected.half_widths[n] for n in names], 0.36, color=colour)
    widths.axvline(WIDEST_HALF_INTERVAL, color="0.2", linestyle="--", label="cannot be told beyond")
    widths.set_yticks(rows, [name.replace("_", " ") for name in names])
    widths.invert_yaxis()
    widths.set_xscale("log")
    widths.set_xlabel("expected half-width of the 95 % interval")
    widths.legend(**LEGEND)
    return figure
