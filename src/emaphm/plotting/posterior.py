"""Figure of a sampled posterior: distribution of each component and its normal approximation."""

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
"""Largest number of intervals between the ticks of an axis: more numbers of four digits would overlap."""

REACH = 1.5
"""Width of an axis relative to the range of the intervals."""


def draw_posterior(diagnosis: "Diagnosis") -> "Figure":
    """Return the figure of the posterior of each component; `diagnosis` must have a posterior."""
    posterior = diagnosis.posterior
    assert posterior is not None  # noqa: S101 - required by the docstring
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
    # The arc of a direction that extends past 1 is drawn unbroken, with the estimate in the same turn.
    lower, upper = estimate.limits
    wraps = interval[1] > upper or estimate.interval95[0] < lower or estimate.interval95[1] > upper
    unwrapped = np.concatenate([values - 1, values, values + 1]) if wraps else values
    turn = float(np.rint(sum(interval) / 2 - estimate.value)) if wraps else 0.0
    normal = (estimate.interval95[0] + turn, estimate.interval95[1] + turn)
    low, high = interval
    if estimate.identifiable:
        low, high = min(low, normal[0]), max(high, normal[1])
    margin = (REACH - 1) / 2 * (high - low)
    if wraps:  # at most one turn
        margin = min(margin, (1 - min(high - low, 1)) / 2)
    first, last = low - margin, high + margin
    if not wraps:
        first, last = max(first, lower), min(last, upper)
    edges = np.linspace(first, last, BINS + 1)
    heights = np.histogram(unwrapped, edges)[0] / (values.size * (edges[1] - edges[0]))
    axis.stairs(heights, edges, fill=True, color=SAMPLED, alpha=0.4, linewidth=0)
    highest = float(np.max(heights))
    if estimate.identifiable:
        x = np.linspace(first, last, 200)
        z = (x - estimate.value - turn) / estimate.standard_error
        density = np.exp(-(z**2) / 2) / (estimate.standard_error * (2 * np.pi) ** 0.5)
        axis.plot(x, density, color=NORMAL, linewidth=1)
        highest = max(highest, float(np.max(density)))
    axis.plot(interval, [-0.06 * highest] * 2, color=SAMPLED, linewidth=3, solid_capstyle="butt")
    axis.set_xlim(first, last)
    axis.set_ylim(-0.12 * highest, 1.05 * highest)
