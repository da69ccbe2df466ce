"""The figure of a sampled posterior: the distribution of each component and its normal approximation."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator import NAMES
from emaphm.arrays import Array
from emaphm.plotting.style import (
    FAINT,
    MODEL,
    PHONE_WIDTH,
    RESIDUAL,
    SMALL_TEXT,
    TEXT,
    legend_above,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from emaphm.diagnosis.result import Diagnosis
    from emaphm.diagnosis.verdict import Estimate

SAMPLED, NORMAL = RESIDUAL, MODEL
"""Colours of the histogram and of the normal curve."""

BINS = 40

MOST_STEPS = 2
"""Between the ticks of an axis: more numbers of four digits would overlap."""

REACH = 1.5
"""Width of an axis, as a multiple of what the intervals cover."""


def draw_posterior(diagnosis: "Diagnosis") -> "Figure":
    """Draw the distribution of each component in the posterior of `diagnosis`, which it must have."""
    posterior = diagnosis.posterior
    assert posterior is not None  # noqa: S101 - whoever draws it has it
    figure = new_figure(PHONE_WIDTH, 3.5)
    axes = figure.subplots(2, 4).ravel()
    for axis, name, values in zip(axes, NAMES, posterior.components.T, strict=True):
        axis.set_title(name, loc="left", fontsize=TEXT)
        axis.tick_params(labelsize=SMALL_TEXT)
        axis.set_yticks([])
        axis.spines[["top", "right", "left"]].set_visible(False)
        axis.locator_params(axis="x", nbins=MOST_STEPS)
        if np.ptp(values) > 0:
            _distribution(axis, values, diagnosis.components[name], posterior.interval95[name])
        else:
            axis.set_xticks([])
            place = axis.transAxes
            axis.text(0.5, 0.5, "not sampled", transform=place, ha="center", fontsize=TEXT, color=FAINT)
    _legend(figure)
    return figure


def _legend(figure: "Figure") -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = {
        "sampled": Patch(color=SAMPLED, alpha=0.4, linewidth=0),
        "its 95 % interval": Line2D([], [], color=SAMPLED, linewidth=3),
        "normal approximation": Line2D([], [], color=NORMAL, linewidth=1),
    }
    legend_above(figure, list(handles.values()), list(handles))


def _distribution(axis: "Axes", values: Array, estimate: "Estimate", interval: tuple[float, float]) -> None:
    """Draw a histogram of `values` (n,), its 95 % `interval` below, and the estimate as a normal curve."""
    # On the circle of a direction, an arc that runs past 1 is drawn whole, the estimate in the same turn.
    lower, upper = estimate.limits
    past = interval[1] > upper or estimate.interval95[0] < lower or estimate.interval95[1] > upper
    around = np.concatenate([values - 1, values, values + 1]) if past else values
    turn = float(np.rint(sum(interval) / 2 - estimate.value)) if past else 0.0
    normal = (estimate.interval95[0] + turn, estimate.interval95[1] + turn)
    low, high = interval
    if estimate.identifiable:
        low, high = min(low, normal[0]), max(high, normal[1])
    margin = (REACH - 1) / 2 * (high - low)
    if past:  # no more than once around
        margin = min(margin, (1 - min(high - low, 1)) / 2)
    first, last = low - margin, high + margin
    if not past:
        first, last = max(first, lower), min(last, upper)
    edges = np.linspace(first, last, BINS + 1)
    heights = np.histogram(around, edges)[0] / (values.size * (edges[1] - edges[0]))
    axis.stairs(heights, edges, fill=True, color=SAMPLED, alpha=0.4, linewidth=0)
    most = float(np.max(heights))
    if estimate.identifiable:
        x = np.linspace(first, last, 200)
        z = (x - estimate.value - turn) / estimate.standard_error
        density = np.exp(-(z**2) / 2) / (estimate.standard_error * (2 * np.pi) ** 0.5)
        axis.plot(x, density, color=NORMAL, linewidth=1)
        most = max(most, float(np.max(density)))
    axis.plot(interval, [-0.06 * most] * 2, color=SAMPLED, linewidth=3, solid_capstyle="butt")
    axis.set_xlim(first, last)
    axis.set_ylim(-0.12 * most, 1.05 * most)
