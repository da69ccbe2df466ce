"""Figures as SVG, the same bytes on every machine and whatever the user's matplotlib settings."""

import base64
import io
import warnings
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


def svg(figure: "Figure") -> bytes:
    """Return `figure` as SVG, which is sharp at any size and has no date in it."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # A name may hold letters that the font lacks: they show as boxes, and nobody can do more about it.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font", category=UserWarning)
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()


def svg_uri(picture: bytes) -> str:
    """Return an SVG as a data URI, as an HTML page can hold it."""
    return "data:image/svg+xml;base64," + base64.b64encode(picture).decode("ascii")
