"""Figure of a load that varies over a recording."""

from typing import TYPE_CHECKING

from emaphm.diagnosis.verdict import Z95
from emaphm.plotting.style import MODEL, PHONE_WIDTH, legend_beside_title, new_figure, style_axis
from emaphm.plotting.time_series import draw_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from emaphm.diagnosis.load_estimate import LoadEstimate
    from emaphm.diagnosis.result import Diagnosis


def draw_external_load(diagnosis: "Diagnosis") -> "Figure":
    """Return the figure of the varying load over time that `diagnosis` has estimated; it must have one."""
    load = diagnosis.load
    assert load is not None  # noqa: S101 - required by the docstring
    figure = new_figure(PHONE_WIDTH, 2.4)
    draw_load_axis(figure.subplots(), diagnosis, load)
    return figure


def draw_load_axis(axis: "Axes", diagnosis: "Diagnosis", load: "LoadEstimate") -> None:
    """Draw the load over time with its 95 % band on `axis`."""
    half, time = Z95 * load.standard_error, diagnosis.time_s
    low, high = load.value - half, load.value + half
    axis.fill_between(time, low, high, color=MODEL, alpha=0.2, linewidth=0, label="95 %")
    draw_line(axis, time, load.value, MODEL, "estimated")
    style_axis(axis, "Load at the motor", "time [s]", f"load [{load.unit}]")
    legend_beside_title(axis)
