"""Figures as text that an HTML page can hold."""

import base64
import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@contextmanager
def plain_style() -> Iterator[None]:
    """Draw dark on white whatever the user's own matplotlib settings, and the same bytes each time."""
    from matplotlib import style

    with style.context(["default", {"svg.hashsalt": "emaphm", "svg.fonttype": "path"}]):
        yield


def data_uri(figure: "Figure") -> str:
    """Return `figure` as a data URI of its SVG, which is sharp at any size and without a date."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")
