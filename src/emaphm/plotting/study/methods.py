"""Common style of methods and their errors in all figures of a study."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from numpy.typing import ArrayLike

from emaphm.arrays import Array
from emaphm.plotting.style import DARK, DASHES, MARKERS, SERIES, Dashes, legend_above, no_formula, shortened

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FLOOR = 1e-3
"""Smallest drawn error [%]: a logarithmic axis has no zero, and smaller errors have no practical meaning."""

LONGEST_NAME = 24


@dataclass(frozen=True)
class Look:
    """Style of a method in all figures."""

    colour: str
    marker: str
    dashes: Dashes

    def hollow(self, size: float) -> dict[str, Any]:
        """Return the style of the hollow marker of a value from the thesis."""
        return {
            "color": self.colour,
            "markersize": size,
            "markerfacecolor": "white",
            "markeredgewidth": 1.2,
        }


def looks(methods: Sequence[str]) -> dict[str, Look]:
    """Return a style for each method, which depends only on its position in the list."""
    return {
        method: Look(
            SERIES[i % len(SERIES)],
            MARKERS[i % len(MARKERS)],
            DASHES[i // len(SERIES) % len(DASHES)],
        )
        for i, method in enumerate(methods)
    }


def label_of(name: str) -> str:
    """Return a name shortened for an axis, and not parsed as a formula."""
    return no_formula(shortened(name, LONGEST_NAME))


def method_legend(figure: "Figure", styles: Mapping[str, Look], *, thesis: bool = False) -> None:
    """Draw a legend of the methods above the figure, with the hollow markers of `thesis` values if any."""
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=look.colour, marker=look.marker, linestyle=look.dashes, markersize=5)
        for look in styles.values()
    ]
    names = [label_of(method) for method in styles]
    if thesis:
        handles.append(
            Line2D([], [], color=DARK, marker="o", linestyle="", markersize=5, markerfacecolor="white")
        )
        names.append("printed in the thesis")
    legend_above(figure, handles, names)


def has_thesis(table: pl.DataFrame) -> bool:
    """Return whether any row has a value from the thesis."""
    return table["thesis"].null_count() < table.height


def floored(values: ArrayLike) -> Array:
    """Return errors [%] for drawing, at least `FLOOR`."""
    return np.asarray(np.maximum(np.asarray(values, float), FLOOR))


def error_label(drawn: pl.Series, label: str) -> str:
    """Return `label`, with a remark if some of the `drawn` errors are below `FLOOR`."""
    return f"{label}, {FLOOR:g} or less at {FLOOR:g}" if (drawn < FLOOR).any() else label
