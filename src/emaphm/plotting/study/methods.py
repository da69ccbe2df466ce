"""How methods and their errors are drawn, alike in every figure of a study."""

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
"""Least error [%] that is drawn: a logarithmic axis has no zero, and less error is of no use to anyone."""

LONGEST_NAME = 24


@dataclass(frozen=True)
class Look:
    """How one method is drawn in every figure."""

    colour: str
    marker: str
    dashes: Dashes

    def hollow(self, size: float) -> dict[str, Any]:
        """Return how a value from the thesis is marked."""
        return {
            "color": self.colour,
            "markersize": size,
            "markerfacecolor": "white",
            "markeredgewidth": 1.2,
        }


def looks(methods: Sequence[str]) -> dict[str, Look]:
    """Return a look for each method; it follows from the place in the list alone."""
    return {
        method: Look(
            SERIES[i % len(SERIES)],
            MARKERS[i % len(MARKERS)],
            DASHES[i // len(SERIES) % len(DASHES)],
        )
        for i, method in enumerate(methods)
    }


def label_of(name: str) -> str:
    """Return a name that fits next to an axis and is no formula."""
    return no_formula(shortened(name, LONGEST_NAME))


def method_legend(figure: "Figure", styles: Mapping[str, Look], *, thesis: bool = False) -> None:
    """Name the methods above the figure, and the thesis's hollow markers if there are any."""
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
    """Return whether the thesis prints a value for any row."""
    return table["thesis"].null_count() < table.height


def floored(values: ArrayLike) -> Array:
    """Return errors [%] as they are drawn, `FLOOR` or more."""
    return np.asarray(np.maximum(np.asarray(values, float), FLOOR))


def error_label(drawn: pl.Series, label: str) -> str:
    """Return `label`, with a remark where some of the errors `drawn` are less than `FLOOR`."""
    return f"{label}, {FLOOR:g} or less at {FLOOR:g}" if (drawn < FLOOR).any() else label
