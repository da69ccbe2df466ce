"""Pages from the templates in this room; text in them is escaped."""

import re
from functools import cache
from typing import TYPE_CHECKING, Any

from emaphm.prognosis.result import hours_text
from emaphm.report.wording import LABELS

if TYPE_CHECKING:
    from jinja2 import Environment
    from starlette.requests import Request

NEVER = "no failure in sight"


def render(template: str, request: "Request", **values: Any) -> bytes:
    """Return the page of `template`, ready to be sent."""
    server = getattr(request.app.state, "server", None)
    has_door = server is not None and server.doorkeeper is not None
    text = _environment().get_template(template).render(values | {"has_door": has_door})
    # A name need not be valid text: what cannot be encoded becomes a question mark.
    return text.encode("utf-8", "replace")


@cache
def _environment() -> "Environment":
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("emaphm.server"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "hours": lambda value: "–" if value is None else f"{value:,.0f}\u00a0h",
        "rul": lambda value: NEVER if value is None else hours_text(value),
        "percent": lambda value: "–" if value is None else f"{100 * value:.1f} %",
        "label": lambda name: LABELS.get(name, name),
        "digits": lambda value: "–" if value is None else f"{value:.4g}",
        "slug": lambda text: (text or "none").replace(" ", "-"),
        "kind": lambda name: name.replace("_", " ").replace("rul", "RUL"),
        "file": lambda name: re.split(r"[/\\]", name)[-1] or name,
        "day": lambda text: text[:10],
        "moment": lambda text: text[:16].replace("T", " "),
    }
    return environment
