"""Signals over time: recorded and modelled, with the number of points limited to the width of a page."""

from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.plotting.style import MODEL, RECORDED, figure_title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_BINS = 700
"""Largest number of point pairs in a line: about one per pixel at the width of a page."""

LONGEST_NAME = 60


def draw_line(
    axis: "Axes", time: Array, values: Array, colour: str, label: str = "", width: float = 1
) -> None:
    """Draw `values` (n,) over `time` (n,) with all their peaks, in at most 2 `MOST_BINS` + 2 points."""
    rows = _extremes(values)
    axis.plot(time[rows], values[rows], color=colour, linewidth=width, label=label)
    axis.margins(x=0)


def draw_recorded_and_model(axis: "Axes", time: Array, recorded: Array, modelled: Array) -> None:
    """Draw a recorded signal and the model's, (n,) each."""
    # The recorded line is wider: it is visible on both sides of a matching model.
    draw_line(axis, time, recorded, RECORDED, "recorded", width=2.5)
    draw_line(axis, time, modelled, MODEL, "model")


def title_with_recording(figure: "Figure", source: str, actuator: Actuator) -> None:
    """Write the names of recording and actuator above the figure; a long name is cut at its start."""
    name = PurePath(source).name
    short = name if len(name) <= LONGEST_NAME else f"…{name[1 - LONGEST_NAME :]}"
    figure_title(figure, f"{short}, actuator {actuator.name}")


def _extremes(values: Array) -> NDArray[np.intp]:
    """Return the rows of the smallest and largest of `values` (n,) in each bin, and of the ends."""
    if values.size <= 2 * MOST_BINS:
        return np.arange(values.size)
    bins = np.array_split(np.arange(values.size), MOST_BINS)
    least = [rows[np.argmin(values[rows])] for rows in bins]
    most = [rows[np.argmax(values[rows])] for rows in bins]
    return np.unique([0, *least, *most, values.size - 1])
