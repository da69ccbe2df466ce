"""SVG of figures, with the same bytes on every machine and for any matplotlib settings of the user."""

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
    """Set the default style, independent of the user's matplotlib settings, with reproducible bytes."""
    from matplotlib import style

    with style.context(["default", {"svg.hashsalt": "emaphm", "svg.fonttype": "path"}]):
        yield


def svg(figure: "Figure") -> bytes:
    """Return `figure` as SVG without a date."""
    buffer = io.BytesIO()
    with missing_glyphs_as_boxes():
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()


@contextmanager
def missing_glyphs_as_boxes() -> Iterator[None]:
    """Draw characters of a name that the font does not have as boxes, without a warning."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font", category=UserWarning)
        yield


def svg_uri(picture: bytes) -> str:
    """Return an SVG as a data URI for an HTML page."""
    return "data:image/svg+xml;base64," + base64.b64encode(picture).decode("ascii")
